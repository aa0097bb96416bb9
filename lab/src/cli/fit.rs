//! `vines fit`: the parameters of a rig from measured points of its backbone.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use vines::fit::{
    CALIBRATION, FitReport, FittedParameter, Found, Hypothesis, HypothesisReport, Known, LinearVerdict, Measurements,
    Quantity, Selection, Stretch, decay_in_words, decimals, find, linear_in_words, requires_sensor, with_decimals,
};
use vines::numerics::Estimate;
use vines::report::fitted;
use vines::scene::{Scene, Units};
use vines::survey::without_other_modes;
use vines::table::{Table, lines};
use vines::{ArgumentError, cells};

use super::failure::Failure;
use super::options::{SceneArguments, positive, warn_implausible};
use super::output::{Results, Written, output, progress_bar, writable};
use super::points::{Column, Measurement, Reading, Source, is_own, measurement};
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
become displacements. The recording gives drive and frequency of phase resonance over the amplitude, with their covariance, from held levels, sweeps
and decays alike, at any phase. The scene says what the sensor reads, and about which rig was recorded: f0 within 1 %, b within 10 %, masses within
15 %. Tables and recordings that `vines` has not written need resonance.sensor there or in --set: q1 for a sensor on the structure.

The linear response of the structure is data as well, for the state of the particle (carried along or free) that agrees with the points. It
comes from tracked.csv, tracked.json or identification.json of a rig that was checked, from `vines check --json`, or from a recording of a
decay without impacts.

Every hypothesis is fitted to the same data, and printed as a row: an ideal cavity; friction, tilt, a restitution that falls with the speed
(viscoelastic or plastic), by periodic motions of the plant; a cubic stiffness; a reference whose gain is wrong (--calibration); and a nonlinear
spring without a particle. Its parameters are
  f0, zeta    natural frequency and damping ratio of the structure without the particle
  r           restitution coefficient
  b           half-width of the cavity
  epsilon     mass ratio m/M
and, if --known gives one of M, m, k and c, the others in SI units. The scene is where the search begins, and what the result is compared with.

A hypothesis is excluded if a channel rejects it (p < 0.001), or if its chi-square exceeds the smallest by more than chance allows (0.1 %). The result is
the range of each parameter over the hypotheses that are left: what is known (--known mu=0, --known b=0.01±0.0001) excludes hypotheses and narrows
it. If none is left, or a spring without a particle is, the exit code is 1.

Examples:
  vines fit out/tracked.csv
  vines fit out/tracked.csv out/identification.json --known m=0.032±0.0005
  vines fit out/tracked.csv ringdown.csv --response y:mm
  vines fit record.csv --response y:mm --drive x:um --rate 5000 --set resonance.sensor=q1
  vines fit table.csv --scene mine.toml --column A=amplitude:mm --column E=base:um --column f=frequency:Hz --column u_A=noise:mm --column u_E=noise_e:um --column u_f=noise_f:Hz
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

    /// A value from elsewhere, with its standard uncertainty; without one it is exact. Of the strength of a hypothesis, 0 excludes it. May be repeated
    #[arg(long, value_name = "SYMBOL=VALUE±U")]
    known: Vec<Known>,

    /// Standard uncertainty of the gain of the reference, relative
    #[arg(long, value_name = "SHARE", default_value_t = CALIBRATION, value_parser = positive)]
    calibration: f64,

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
    /// What the data say of linear responses.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    linear: &'a [LinearVerdict],
    /// The motions of recordings.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    stretches: &'a [Stretch],
    /// How recordings were read, linear decays, and what counts as exact.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

/// What the points say of a linear response.
fn of_linear(verdict: &LinearVerdict) -> String {
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
    format!(
        "linear response: {}: {rises}: {result}",
        linear_in_words(&verdict.linear)
    )
}

/// What the files contain.
struct Gathered {
    measured: Measurements,
    /// Number of points that are left out.
    skipped: usize,
    /// How recordings were read, linear decays, and what counts as exact.
    notes: Vec<String>,
}

/// The files, each with what is in it.
fn sources<'a>(
    files: &'a [PathBuf],
    read: &dyn Fn(&Path) -> Result<Source, ArgumentError>,
) -> Result<Vec<(&'a PathBuf, Source)>, Failure> {
    let source = |(n, path): (usize, &'a PathBuf)| match files[..n].contains(path) {
        true => Err(Failure::input(format!(
            "{} is given twice: its data would count twice, and the uncertainties be too small",
            path.display()
        ))),
        false => Ok((path, read(path).map_err(Failure::input)?)),
    };
    files.iter().enumerate().map(source).collect()
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
    let mut measured = Measurements {
        known,
        calibration: arguments.calibration,
        ..Measurements::default()
    };
    let (mut skipped, mut notes) = (0, Vec::new());
    let sources = sources(&arguments.points, read)?;
    let reading = Reading {
        columns: &arguments.column,
        phase: scene.definition().phase,
        scene,
        beside_others: sources
            .iter()
            .any(|(_, source)| matches!(source, Source::Channels(contents) if !is_own(contents))),
    };
    for (path, source) in sources {
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
                        notes.push(format!("{}: {}", recording.origin, decay_in_words(&decay)));
                        measured.linear.push(decay);
                    }
                    None => {
                        if !recording.is_own {
                            requires_sensor(&recording.origin, scene).map_err(Failure::input)?;
                        }
                        measured.recordings.push(recording);
                    }
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

/// The scene with what is known of its plant.
fn with_known(scene: &Scene, known: &[Known]) -> Scene {
    let mut scene = scene.clone();
    let plant = &mut scene.plant;
    for known in known {
        if let Known::Value { quantity, estimate: Estimate { value, .. } } = *known {
            match quantity {
                Quantity::B => plant.half_width = value,
                Quantity::PrimaryMass => plant.primary_mass = value,
                Quantity::ParticleMass => plant.particle_mass = value,
                Quantity::Stiffness => plant.stiffness = value,
                Quantity::Damping => plant.damping = value,
                Quantity::Epsilon => plant.particle_mass = value * plant.primary_mass,
                Quantity::F0 | Quantity::Zeta | Quantity::R => {}
            }
        }
    }
    scene
}

/// `read`: as of [`gathered`].
pub(super) fn run(
    arguments: &Arguments,
    read: &dyn Fn(&Path) -> Result<Source, ArgumentError>,
) -> Result<Results, Failure> {
    let scene = arguments.scene.load()?;
    warn_implausible(&with_known(&scene, &arguments.known), "--known has");
    writable([&arguments.figure, &arguments.out].into_iter().flatten())?;
    let Gathered { measured, skipped, notes } = gathered(arguments, &scene, read)?;
    if measured.points.is_empty() && measured.recordings.is_empty() && skipped == 0 && !notes.is_empty() {
        if let Some(path) = arguments.out.as_ref().or(arguments.figure.as_ref()) {
            return Err(Failure::input(format!(
                "{}: linear decays alone have no fit to write; add points or a recording with impacts",
                path.display()
            )));
        }
        let text = output(arguments.json, &serde_json::json!({ "notes": notes }), || lines(&notes))?;
        return Ok(text.into());
    }
    let bar = progress_bar(Hypothesis::ALL.len() as u64, "fitting", "hypotheses");
    let found = find(&measured, &scene, |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let found = found.map_err(Failure::run)?;
    let report = found.report(&scene.plant);
    let printed = Output {
        report: &report,
        linear: &found.linear,
        stretches: &found.stretches,
        notes: notes.clone(),
    };
    let skipped = (skipped > 0).then(|| format!("{skipped} points are not settled or not symmetric 1:1, and left out"));
    let text = output(arguments.json, &printed, || {
        [
            lines(&notes),
            recorded(&found.stretches),
            lines(skipped),
            hypotheses(&report).text(),
            "\n".into(),
            parameters(&report).text(),
            format!("{}\n", verdict(&report)),
            lines(found.linear.iter().map(of_linear)),
        ]
        .concat()
    })?;
    let Arguments { figure, out, .. } = arguments.clone();
    let plant = plant_section(&report, &found.plant(&scene.plant));
    let scene_text = provenance(&arguments.points, &report) + &arguments.scene.with_plant(&plant)?;
    Ok(Results::new(text, arguments.json, move || {
        let mut files = Written::default();
        if let Some(path) = &figure {
            let figure = fitted(&found, &scene).svg();
            files.add(vines::write_file(path, &figure).map(Some));
        }
        if let Some(path) = &out {
            files.add(vines::write_file(path, &scene_text).map(Some));
        }
        if !report.describes {
            files
                .failures
                .push(Failure::run(contradiction(&found, &report, &scene)));
        }
        files
    }))
}

/// The motions of recordings.
fn recorded(stretches: &[Stretch]) -> String {
    let rows = stretches.iter().map(|one| {
        let [from, to] = one.seconds.map(|time| format!("{time:.2}"));
        let [low, high] = one.response_m.map(|amplitude| format!("{:.3}", 1e3 * amplitude));
        [from, to, one.motion.to_string(), low, high]
    });
    let table = Table::new("from, s | to, s | motion | smallest response, mm | largest, mm").rows(rows);
    if stretches.is_empty() {
        String::new()
    } else {
        table.text() + "\n"
    }
}

/// Every hypothesis in a row.
fn hypotheses(report: &FitReport) -> Table {
    let rows = report.hypotheses.iter().map(|one| {
        let HypothesisReport { hypothesis, symbol, unit, chi_square, degrees, .. } = one;
        let strength = one.strength.zip(one.u_strength).map(with_decimals);
        let strength = strength.map(|value| format!("{symbol} = {}", with_unit(&value, unit)));
        let friction = one.friction.zip(one.u_friction).map(with_decimals);
        let friction = friction.map(|value| format!("mu = {value}"));
        let values = one
            .parameters
            .iter()
            .map(|one| with_decimals((one.value, one.uncertainty)));
        let values: Vec<String> = values.collect();
        let value = |n: usize| values.get(n).cloned().unwrap_or_default();
        let p = one.p_value.map(|p| match p < 1e-3 {
            true => format!("{p:.0e}"),
            false => format!("{p:.3}"),
        });
        cells![
            *hypothesis,
            strength.into_iter().chain(friction).collect::<Vec<_>>().join(", "),
            value(0),
            value(1),
            value(2),
            value(3),
            value(4),
            format!("{chi_square:.1}"),
            *degrees,
            p.unwrap_or_default(),
            if one.excluded.is_some() { "excluded" } else { "possible" }
        ]
    });
    Table::new("hypothesis | strength | f0, Hz | zeta | r | b, m | epsilon | chi-square | for | p | ").rows(rows)
}

/// The parameters of a fit beside those of the scene.
fn parameters(report: &FitReport) -> Table {
    let is_possible = report.hypotheses.iter().any(|one| one.excluded.is_none());
    let doubt = if is_possible { "" } else { " (rejected)" };
    let rows = report.parameters.iter().map(|parameter| {
        let FittedParameter { symbol, unit, value, uncertainty, expected } = *parameter;
        let [value, expected, difference] = match exact(parameter) {
            Some(value) => [format!("{value} (exact)"), format!("{expected:.4}"), String::new()],
            None => [
                with_decimals((value, uncertainty)) + doubt,
                format!("{expected:.0$}", decimals(uncertainty)),
                Some((value - expected) / uncertainty)
                    .filter(|u| u.is_finite())
                    .map_or_else(String::new, |u| format!("{u:+.1} u")),
            ],
        };
        cells![symbol, value, unit, expected, difference]
    });
    Table::new("parameter | value | unit | scene | difference").rows(rows)
}

/// What the hypotheses say together.
fn verdict(report: &FitReport) -> String {
    let possible = report.hypotheses.iter().filter(|one| one.excluded.is_none());
    let possible: Vec<&str> = possible.map(|one| one.hypothesis).collect();
    let undetermined = match &report.undetermined[..] {
        [] => String::new(),
        some => format!(
            "; the data do not determine {}: measure at least three levels far apart, with `vines backbone` (--record for a recording), a decay, or \
             what --known takes: b with a ruler, masses with a scale",
            some.join(", ")
        ),
    };
    let found = match &possible[..] {
        [] => "none of these describes the data".into(),
        some => format!(
            "± is the range over what is possible: {}{undetermined}",
            some.join(", ")
        ),
    };
    match &report.not_fitted[..] {
        [] => found,
        some => format!(
            "{found}\nnot fitted, and not excluded: {}; the plant has no motions with these responses near the scene: give a scene that is nearer to the rig",
            some.join(", ")
        ),
    }
}

/// Why the exit code is 1.
fn contradiction(found: &Found, report: &FitReport, scene: &Scene) -> String {
    // A wrong unit shows beside the scene.
    let linear = scene.knowledge().linear;
    let Units { response, reference, .. } = scene.units();
    let read = found.data.points.first().map_or_else(String::new, |point| {
        let least = linear.bandwidth() * point.response.value;
        format!(
            "\nare the units right? Point 1 was read as {:.4} Hz with a response of {:.4e} and a drive of {:.4e}; the scene has {:.4} Hz and b = {} m, and \
             without impacts a drive of {:.4e} for this response",
            point.omega.value / TAU,
            response.quantity(point.response.value),
            reference.quantity(point.drive.value),
            linear.omega0 / TAU,
            scene.plant.half_width,
            reference.quantity(least)
        )
    });
    match found.hypotheses.possible().next() {
        Some(_) => "a nonlinear spring without a particle describes the data: nothing in them shows impacts".into(),
        None => format!(
            "none of these hypotheses describes the data; nearest is {}: {}{read}",
            report.best,
            found.worst()
        ),
    }
}

/// Where the plant of a scene comes from.
fn provenance(files: &[PathBuf], report: &FitReport) -> String {
    let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    let p = report.p_value.map_or_else(String::new, |p| format!(", p = {p:.2}"));
    format!(
        "# Fitted by vines {} to {}: {},\n# chi-square {:.1} for {} degrees of freedom{p}.\n\n",
        env!("CARGO_PKG_VERSION"),
        files.join(", "),
        report.best,
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
fn plant_section(report: &FitReport, plant: &vines::scene::Parameters) -> String {
    let lines = vines::scene::plant_keys(plant).into_iter().map(|(symbol, value)| {
        let fitted = report.parameters.iter().find(|one| one.symbol == symbol);
        match fitted.map(|one| (exact(one), one.uncertainty)) {
            None => format!("{symbol} = {value}\n"),
            Some((Some(value), _)) => format!("{symbol} = {value}  # exact\n"),
            Some((None, u)) => format!("{symbol} = {value}  # ± {u:.0$}\n", decimals(u)),
        }
    });
    let scale = match report.parameters.iter().any(|one| one.symbol == "M") {
        true => "",
        false => "# Masses, stiffness and damping are scaled by the mass of the scene.\n",
    };
    let doubt = match report.describes {
        true => "",
        false => "# Rejected: no hypothesis with a particle alone describes the data.\n",
    };
    format!(
        "[plant]\n# ± is the range over all hypotheses that are possible.\n{doubt}{scale}# The values are correlated: their digits keep what they determine together, such as k/M.\n{}",
        lines.collect::<String>()
    )
}
