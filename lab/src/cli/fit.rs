//! `vines fit`: the parameters of a rig from measured points of its backbone.

use std::cmp::Ordering;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use vines::fit::{
    Candidate, Effect, EffectReport, Explanation, Fit, FitReport, FittedParameter, Found, Known, LeftOut,
    LinearVerdict, MeasuredPoint, Measurements, Part, Quantity, Selection, decimals, find,
};
use vines::numerics::Estimate;
use vines::report::fitted;
use vines::scene::{Scene, Units};
use vines::survey::without_other_modes;
use vines::table::{Table, lines};
use vines::{ArgumentError, cells};

use super::failure::Failure;
use super::options::{SceneArguments, positive};
use super::output::{Results, Written, output, progress_bar, writable};
use super::points::{Column, Measurement, Reading, Source, measurement};
use super::summary::with_unit;

const HELP: &str = "\
A point has the frequency of phase resonance f, the amplitude A of the response and the amplitude E of the base, each with its standard
uncertainty: a locked point of `vines identify` (identification.json), the points of `vines backbone` (tracked.csv), or a table of yours
with the columns f_Hz, A_m, E_m, u_f_Hz, u_A_m and u_E_m, or others that --column names. Where a force drives, E is its amplitude in N,
with the columns F_N and u_F_N. Points that are not settled (columns settled and reached), or whose motion is not nonlinear and symmetric
(motion), are left out. The column phase_target_deg is the phase of the response relative to the base, degrees, at which a point was
measured; without it, it is the scene's controller.phase_target.

A recording has two channels over time, the response and the base. Delimiter, decimal mark, names and units are found;
a file of `vines` needs no options. `python -m vines fit` has the same options, and reads other tables and formats. A channel is NAME or NAME:UNIT, with a name or a number of a column, and a unit (mm, µm, mm/s,
m/s², g) or a multiple of it (-1g), the sensitivity of a sensor (100mV/g, 8V/mm, 125mm/s/V), or metres per unit. Velocities and accelerations
become displacements harmonic by harmonic. Held stretches, slow sweeps and decays near phase resonance become points.
The scene says what the sensor reads, and about which natural frequency and damping the structure has.

The linear response of the structure is data as well, for the state of the particle (carried along or free) that agrees with the points. It
comes from tracked.csv, tracked.json or identification.json of a rig that was checked, from `vines check --json`, or from a recording of a
decay without impacts.

The model is the exact symmetric 1:1 motion of a linear oscillator and a particle between two walls. The fit finds
  f0, zeta    natural frequency and damping ratio of the structure without the particle
  r           restitution coefficient
  b           half-width of the cavity
  epsilon     mass ratio m/M
and, if --known gives one of M, m, k and c, the others in SI units. The scene is where the search begins, and what the result is compared with.

If the model does not describe all points (probability of so large a chi-square below 1 %), friction, tilt, two laws of a restitution that
depends on the speed, and a cubic stiffness are fitted one at a time, by periodic motions of the plant. If one of them describes the points, the
result is its fit. If none does, at most a fifth of the points are left out; if that does not help, every line says so, and the exit code is 1.

Examples:
  vines fit out/tracked.csv
  vines fit out/tracked.csv out/identification.json --known m=0.032±0.0005
  vines fit out/tracked.csv ringdown.csv --response y:mm
  vines fit record.csv --response y:mm --drive x:um --rate 5000 --scene mine.toml
  vines fit table.csv --column A=amplitude:mm --column E=base:um --column f=frequency:Hz --column u_A=noise:mm --column u_E=noise_e:um --column u_f=noise_f:Hz
  vines fit out/tracked.csv --out rig.toml      a scene with the fitted plant, for every other command";

/// Fit the parameters of a rig to measured points of its backbone
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    /// Files with points or recordings: CSV, tracked.json or identification.json
    #[arg(value_name = "FILE", required = true)]
    points: Vec<PathBuf>,

    #[command(flatten)]
    scene: SceneArguments,

    /// A value from elsewhere, with its standard uncertainty; without one it is exact. May be repeated
    #[arg(long, value_name = "SYMBOL=VALUE±U")]
    known: Vec<Known>,

    /// Name and unit of a column; may be repeated
    #[arg(long, value_name = "QUANTITY=NAME:UNIT")]
    column: Vec<Column>,

    /// Channel of the response in a recording
    #[arg(long, value_name = "NAME[:UNIT]")]
    response: Option<String>,

    /// Channel of the base in a recording
    #[arg(long, value_name = "NAME[:UNIT]")]
    drive: Option<String>,

    /// Channel of the time in a recording; without it, a channel `time` or `t`
    #[arg(long, value_name = "NAME[:UNIT]")]
    time: Option<String>,

    /// Time by which the channel of the base is later than that of the response, s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    late: Option<f64>,

    /// Samples a second of a recording
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate: Option<f64>,

    /// Write a scene with the fitted plant
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Write a figure (SVG): the points beside the scene and the fit, and the residuals, over amplitude
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Output<'a> {
    #[serde(flatten)]
    report: &'a FitReport,
    /// What the candidates say where the ideal cavity does not describe all points.
    #[serde(skip_serializing_if = "Option::is_none")]
    verdict: Option<String>,
    /// Effects with which other parameters describe the points as well.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    alternatives: Vec<EffectReport>,
    /// What the points say of linear responses.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    linear: &'a [LinearVerdict],
    /// Parts of recordings.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    parts: &'a [Part],
    /// Periods of recordings that the plant follows.
    #[serde(skip_serializing_if = "Option::is_none")]
    followed_periods: Option<usize>,
    /// Parts of recordings that do not belong to the motion.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    left_out_of_record: &'a [LeftOut],
    /// Why the points of recordings are fitted instead of the recordings themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    points_instead: Option<&'a str>,
    /// Recordings that are far from the phase target half of the time in which the base moves.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    off_target: &'a [String],
    /// How recordings were read, linear decays, and what counts as exact.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

/// What the intervals depend on: other cavities that would give the same points. `is_assumed`: whether an ideal cavity is assumed, and no measured
/// half-width confirms it.
fn only_if_ideal(alternatives: &[EffectReport], is_assumed: bool) -> String {
    let texts: Vec<String> = alternatives
        .iter()
        .map(|one| {
            let EffectReport {
                effect, symbol, unit, strength, uncertainty, possible_b_m, ..
            } = one;
            // Of those whose strength is given this is the largest.
            let up_to = if *uncertainty == 0.0 { "up to" } else { "with" };
            let (digits, mm) = (decimals(strength.abs()), 1e3 * possible_b_m);
            let strength = with_unit(&format!("{strength:.digits$}"), unit);
            format!("{effect} {up_to} {symbol} = {strength} (b = {mm:.2} mm) would give the same points")
        })
        .collect();
    if texts.is_empty() {
        let text = "the intervals hold if the cavity is ideal\n";
        return if is_assumed { text.into() } else { String::new() };
    }
    format!(
        "the intervals hold if the cavity is ideal: {}. Measure b with a ruler and the masses with a scale, and give --known b=VALUE±U and \
         --known epsilon=VALUE±U\n",
        texts.join("; ")
    )
}

/// What the effects of a real cavity say.
fn explained(explanation: &Explanation) -> String {
    let chi_square = |fit: &Fit| format!("{:.0} for {}", fit.chi_square, fit.degrees);
    let without = chi_square(&explanation.ideal);
    let possible = explanation.possible().map(|candidate| {
        let EffectReport { effect, symbol, unit, left_out, .. } = candidate.report();
        let strength = with_unit(&with_decimals(candidate.strength), unit);
        let without = match left_out {
            0 => String::new(),
            _ => {
                format!("; {left_out} points of the smallest responses do not belong to this motion, and are left out")
            }
        };
        let chi_square = chi_square(&candidate.fit);
        format!("{effect} alone ({symbol} = {strength}, chi-square {chi_square}{without})")
    });
    let possible: Vec<String> = possible.collect();
    match &possible[..] {
        [] => {
            let tried = explanation.candidates.iter();
            let tried = tried.map(|one| format!("{} ({})", one.effect.names()[0], chi_square(&one.fit)));
            let tried = match tried.collect::<Vec<String>>().join(", ") {
                none if none.is_empty() => "none of them a motion exists".into(),
                some => some,
            };
            format!("no single effect explains it: chi-square is {without} without one, with {tried}")
        }
        [one] => format!("{one} explains it; without it, chi-square is {without}"),
        several => format!(
            "{} explains it, the points do not say which; without it, chi-square is {without}",
            several.join(" or ")
        ),
    }
}

/// What the points say of a linear response.
fn of_linear(verdict: &LinearVerdict) -> String {
    let [f0, zeta] = verdict.linear.estimates().map(with_decimals);
    let rises = ["with the particle carried along", "with a free particle"]
        .into_iter()
        .zip(verdict.rises)
        .filter_map(|(state, rise)| Some(format!("{state} chi-square rises by {:.1}", rise?)));
    let rises = rises.collect::<Vec<String>>().join(", ");
    let result = match verdict.agrees() {
        [true, false] => "the particle was carried along; both are data of the fit",
        [false, true] => "the particle was free; both are data of the fit",
        [true, true] => "the points do not tell the state of the particle, and both are left out",
        [false, false] => {
            "the points contradict them, and both are left out: a cavity that is not ideal or a particle that slides may be the reason"
        }
    };
    format!("linear response: f0 = {f0} Hz, zeta = {zeta}: {rises}: {result}")
}

/// A value and its standard uncertainty with two digits of it.
fn with_decimals(Estimate { value, uncertainty }: Estimate) -> String {
    let decimals = decimals(uncertainty);
    format!("{value:.decimals$} ± {uncertainty:.decimals$}")
}

/// What the files contain.
struct Gathered {
    measured: Measurements,
    /// Number of points that are left out.
    skipped: usize,
    /// How recordings were read, linear decays, and what counts as exact.
    notes: Vec<String>,
}

/// `read` reads the files: the program plain tables and its own files, the Python package others as well.
fn gathered(
    arguments: &Arguments,
    scene: &Scene,
    read: &dyn Fn(&Path) -> Result<Source, ArgumentError>,
) -> Result<Gathered, Failure> {
    let modes = scene.structure.as_ref().map_or(1, |structure| structure.modes.len());
    let Arguments { known, response, drive, time, rate, late, .. } = arguments.clone();
    let selection = Selection { response, drive, time, rate, late };
    let mut measured = Measurements { known, ..Measurements::default() };
    let (mut skipped, mut notes) = (0, Vec::new());
    for path in &arguments.points {
        let reading = Reading {
            columns: &arguments.column,
            phase: scene.definition().phase,
            units: scene.units(),
        };
        let source = read(path).map_err(Failure::input)?;
        match measurement(path, source, reading, &selection).map_err(Failure::input)? {
            Measurement::Points(points, left_out, linear) => {
                measured.points.extend(points);
                skipped += left_out;
                // Several files of one run have the same response.
                let linear = linear.filter(|one| !measured.linear.contains(one));
                measured.linear.extend(linear);
            }
            Measurement::Recording(_) if modes > 1 => {
                return Err(Failure::input(format!(
                    "a recording is fitted for one oscillator, and the structure has {modes} modes: give tracked.csv of `vines backbone`"
                )));
            }
            Measurement::Recording(recording) => {
                notes.extend(recording.notes.iter().cloned());
                match recording.linear_decay(&scene.knowledge()).map_err(Failure::run)? {
                    Some(decay) => {
                        notes.push(format!("{}: {decay}", recording.origin));
                        measured.linear.push(decay.into());
                    }
                    None => measured.recordings.push(recording),
                }
            }
        }
    }
    let structure = scene.structure.as_ref();
    let others = match structure.is_some_and(|structure| structure.shaker.is_some()) {
        true => Some("the other modes and the shaker"),
        false => (modes > 1).then_some("the other modes"),
    };
    if let Some(others) = others {
        let count = measured.points.len();
        measured.points = without_other_modes(scene, measured.points);
        skipped += count - measured.points.len();
        notes.push(format!(
            "points are moved to where the driven mode alone would have them, by exact orbits with and without {others} of the scene"
        ));
    }
    notes.extend(arguments.known.iter().filter_map(|known| match known {
        Known::Value { quantity, estimate: Estimate { value, uncertainty: 0.0 } } => Some(format!(
            "{symbol} = {value} has no uncertainty and counts as exact; give it as --known {symbol}={value}±U unless it is",
            symbol = quantity.symbol()[0]
        )),
        _ => None,
    }));
    Ok(Gathered { measured, skipped, notes })
}

/// `read`: as of [`gathered`].
pub(super) fn run(
    arguments: &Arguments,
    read: &dyn Fn(&Path) -> Result<Source, ArgumentError>,
) -> Result<Results, Failure> {
    let scene = arguments.scene.load()?;
    writable([&arguments.figure, &arguments.out].into_iter().flatten())?;
    let Gathered { measured, skipped, notes } = gathered(arguments, &scene, read)?;
    if measured.points.is_empty() && measured.recordings.is_empty() && skipped == 0 && !notes.is_empty() {
        let text = output(arguments.json, &serde_json::json!({ "notes": notes }), || lines(&notes))?;
        return Ok(Results::new(text, Written::default));
    }
    let bar = progress_bar(Effect::ALL.len() as u64, "fitting", "effects of a real cavity");
    let found = find(&measured, &scene, |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let found = found.map_err(Failure::run)?;
    let (report, record) = (found.fit.report(&scene.plant), found.record.as_ref());
    let verdict = found.explanation.as_ref().map(explained);
    let alternatives: Vec<EffectReport> = found.alternatives.iter().map(Candidate::report).collect();
    let is_width = |known: &Known| matches!(known, Known::Value { quantity: Quantity::B, .. });
    let is_ideal = found.explanation.is_none() && !found.fit.is_rejected();
    let is_assumed = is_ideal && !arguments.known.iter().any(is_width);
    let printed = Output {
        report: &report,
        verdict: verdict.clone(),
        alternatives: alternatives.clone(),
        linear: &found.linear,
        parts: &found.parts,
        followed_periods: record.map(|record| record.periods),
        left_out_of_record: record.map_or(&[], |record| &record.left_out),
        points_instead: found.points_instead.as_deref(),
        off_target: &found.off_target,
        notes: notes.clone(),
    };
    let text = output(arguments.json, &printed, || {
        [
            lines(&notes),
            recorded(&found.parts, &scene.units()),
            summary(&report, &found, skipped),
            lines(found.points_instead.as_ref()),
            lines(&found.off_target),
            lines(found.linear.iter().map(of_linear)),
            lines(&verdict),
            only_if_ideal(&alternatives, is_assumed),
        ]
        .concat()
    })?;
    let Arguments { figure, out, json, .. } = arguments.clone();
    let Found { fit, plant, points, .. } = found;
    let plant = plant_section(&report, &plant, verdict.as_deref());
    let scene_text = provenance(&arguments.points, &report) + &arguments.scene.with_plant(&plant)?;
    Ok(Results::new(text, move || {
        let mut files = Written::default();
        if let Some(path) = &figure {
            let figure = fitted(&points, &fit, &scene, verdict.as_deref()).svg();
            files.add(vines::write_file(path, &figure).map(Some));
        }
        if let Some(path) = &out {
            files.add(vines::write_file(path, &scene_text).map(Some));
        }
        if json {
            files.paths.clear();
        }
        if !report.describes {
            files.failures.push(Failure::run(format!(
                "the model does not describe the points: chi-square is {:.0} for {} degrees of freedom. Uncertainties that are too small, \
                 points of several branches, or several effects at a time may be the reason",
                fit.chi_square, fit.degrees
            )));
        }
        files
    }))
}

/// The parts of recordings, in the units of the channels: lengths in mm.
fn recorded(parts: &[Part], units: &Units) -> String {
    if parts.is_empty() {
        return String::new();
    }
    let (drive, scale) = match units.reference.symbol {
        "N" => ("F, N", 1.0),
        _ => ("E, mm", 1e3),
    };
    let rows = parts.iter().map(|part| {
        let [from, to] = part.seconds.map(|time| format!("{time:.2}"));
        let kind = format!("{:?}", part.kind).to_lowercase();
        let values = part.point.map(|point| {
            let MeasuredPoint { response, omega, drive, .. } = point.in_units(units);
            [omega.scaled(1.0 / TAU), response.scaled(1e3), drive.scaled(scale)].map(with_decimals)
        });
        let [f, a, e] = values.unwrap_or_default();
        [from, to, kind, part.regime.to_string(), f, a, e]
    });
    Table::new(&format!("from, s | to, s | part | motion | f, Hz | A, mm | {drive}"))
        .rows(rows)
        .text()
        + "\n"
}

/// The parameters beside those of the scene, whether the model describes the data, and what in them is not as it should be.
fn summary(report: &FitReport, found: &Found, skipped: usize) -> String {
    let record = found.record.as_ref();
    let of_record = record.iter().flat_map(|record| &record.left_out);
    let of_record = of_record.map(|LeftOut { origin, seconds: [from, to] }| {
        format!("{origin}: {from:.2} s to {to:.2} s does not belong to the motion, and is left out")
    });
    let skipped = (skipped > 0).then(|| format!("{skipped} points are not settled or not symmetric 1:1, and left out"));
    let numbers: Vec<String> = report.left_out.iter().map(usize::to_string).collect();
    let contradicting = (!numbers.is_empty()).then(|| {
        format!(
            "{} of {} points contradict the others, and are left out: {}",
            numbers.len(),
            found.points.len(),
            numbers.join(", ")
        )
    });
    let notes = of_record
        .chain(wrong_uncertainties(report))
        .chain(skipped)
        .chain(contradicting);
    let verdict = chi_square(report, record.map(|record| record.periods));
    format!("{}\n{verdict}\n{}", parameters(report).text(), lines(notes))
}

/// The parameters of a fit beside those of the scene.
fn parameters(report: &FitReport) -> Table {
    let doubt = if report.describes { "" } else { " (rejected)" };
    let rows = report.parameters.iter().map(|parameter| {
        let FittedParameter { symbol, unit, value, uncertainty, expected } = *parameter;
        let [value, expected, difference] = match exact(parameter) {
            Some(value) => [format!("{value} (exact)"), format!("{expected:.4}"), String::new()],
            None => [
                with_decimals(Estimate { value, uncertainty }) + doubt,
                format!("{expected:.0$}", decimals(uncertainty)),
                format!("{:+.1} u", (value - expected) / uncertainty),
            ],
        };
        cells![symbol, value, unit, expected, difference]
    });
    Table::new("parameter | value | unit | scene | difference").rows(rows)
}

/// What chi-square says; `periods`: of recordings, if they are fitted.
fn chi_square(report: &FitReport, periods: Option<usize>) -> String {
    let p = report
        .p_value
        .map_or_else(|| "without a degree of freedom".into(), |p| format!("p = {p:.2}"));
    let verdict = match (report.describes, &report.undetermined[..]) {
        (true, []) => "the model describes them".into(),
        (true, undetermined) => format!(
            "this says little, because they do not determine {}. Measure at least three levels far apart, with `vines backbone` (--record \
             for a recording), or give --known",
            undetermined.join(", ")
        ),
        (false, _) => "the model does not describe them".into(),
    };
    let what = match periods {
        Some(periods) => format!("{periods} periods of recordings"),
        None => format!("{} points", report.residuals.len()),
    };
    let FitReport { chi_square, degrees, .. } = report;
    format!("{what}; chi-square {chi_square:.1} for {degrees} degrees of freedom ({p}): {verdict}")
}

/// The channels whose uncertainties do not agree with their residuals.
fn wrong_uncertainties(report: &FitReport) -> impl Iterator<Item = String> {
    let channels = ["responses", "frequencies", "drives"].into_iter().zip(&report.channels);
    channels.filter_map(|(channel, test)| {
        let size = match test.verdict() {
            Some(Ordering::Less) => "small",
            Some(Ordering::Greater) => "large",
            _ => return None,
        };
        let [found, expected] = [test.chi_square, test.expected];
        let decimals = decimals(found.min(expected));
        Some(format!(
            "the uncertainties of the {channel} are too {size}: their chi-square is {found:.decimals$}, and {expected:.decimals$} is expected"
        ))
    })
}

/// Where the plant of a scene comes from.
fn provenance(files: &[PathBuf], report: &FitReport) -> String {
    let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    let p = report.p_value.map_or_else(String::new, |p| format!(", p = {p:.2}"));
    format!(
        "# Fitted by vines {} on {} to {} points of {}:\n# chi-square {:.1} for {} degrees of freedom{p}.\n\n",
        env!("CARGO_PKG_VERSION"),
        chrono::Utc::now().format("%Y-%m-%d"),
        report.residuals.len(),
        files.join(", "),
        report.chi_square,
        report.degrees
    )
}

/// The value of a parameter that was given as exact: the fit keeps all digits of a number that people write.
fn exact(parameter: &FittedParameter) -> Option<f32> {
    let FittedParameter { value, uncertainty, .. } = *parameter;
    (uncertainty < 1e-8 * value.abs()).then_some(value as f32)
}

/// The section `[plant]` of a scene, with the standard uncertainties in comments.
fn plant_section(report: &FitReport, plant: &vines::scene::Parameters, verdict: Option<&str>) -> String {
    let lines = vines::scene::plant_keys(plant).into_iter().map(|(symbol, value)| {
        let fitted = report.parameters.iter().find(|one| one.symbol == symbol);
        match fitted.map(|one| (exact(one), one.uncertainty)) {
            None => format!("{symbol} = {value}\n"),
            Some((Some(value), _)) => format!("{symbol} = {value}  # exact\n"),
            Some((None, u)) => format!("{symbol} = {value}  # ± {u:.0$}\n", decimals(u)),
        }
    });
    let verdict = verdict.map(|verdict| format!("# {verdict}\n")).unwrap_or_default();
    let scale = match report.parameters.iter().any(|one| one.symbol == "M") {
        true => "",
        false => "# Masses, stiffness and damping are scaled by the mass of the scene.\n",
    };
    let doubt = match report.describes {
        true => "",
        false => "# Rejected: the model does not describe the points.\n",
    };
    format!(
        "[plant]\n{verdict}{doubt}{scale}# The values are correlated: their digits keep what they determine together, such as k/M.\n{}",
        lines.collect::<String>()
    )
}
