//! Results in words and tables.

use vines::backbone::LevelPoint;
use vines::cells;
use vines::comparison::{COMPARED_ABOVE, Comparison, TrackedComparison, TrackedPoint};
use vines::fit::{Contradiction, FittedParameter};
use vines::identification::{DecayEnd, Friction, Lock, Regime, ResonancePoint, Tone};
use vines::numerics::SIGNIFICANT;
use vines::orbit::Orbit;
use vines::regime_map::Map;
use vines::scene::{Definition, Dimensionless, Scene, Units};
use vines::table::{Table, lines, note, with_uncertainty};

/// The dimensionless numbers of a scene, in one line.
pub(super) fn parameters(p: &Dimensionless) -> String {
    let definition = match p.definition == Definition::default() {
        true => String::new(),
        false => format!("; resonance: {}", p.definition.name()),
    };
    format!("{}, G = {:.4}{definition}", rig(p), p.g)
}

fn rig(p: &Dimensionless) -> String {
    let Dimensionless { epsilon, lambda, r, .. } = p;
    format!("epsilon = {epsilon:.6}, lambda = {lambda:.4}, r = {r}")
}

/// What response and drive of a scene are called, with their units.
pub(super) fn channels(scene: &Scene) -> [(String, &'static str); 2] {
    let Units { reference, response, .. } = scene.units();
    let [of_response, of_drive] = match &scene.structure {
        None => ["response".into(), "base".into()],
        Some(structure) => {
            let point = |n: usize| &structure.points[n];
            let drive = structure
                .drive
                .map_or("base".into(), |n| format!("force at {}", point(n)));
            [format!("response at {}", point(structure.sensor)), drive]
        }
    };
    [(of_response, response.symbol), (of_drive, reference.symbol)]
}

/// Frequency in hertz, amplitude of response and drive in their units, with their uncertainties.
fn values(at: &ResonancePoint) -> [String; 3] {
    let (drive, value) = (at.drive(), |value: f64, u: f64| format!("{value:.5e} ± {u:.1e}"));
    [
        with_uncertainty(at.f_hz, at.u_f_hz),
        value(at.a_m, at.u_a_m),
        value(drive.value, drive.uncertainty),
    ]
}

/// A value with its unit, which may be empty.
pub(super) fn with_unit(value: &str, unit: &str) -> String {
    format!("{value} {unit}").trim_end().into()
}

/// How measured points contradict the scene.
pub(super) fn contradicts(contradiction: &Contradiction) -> String {
    let Contradiction { points, chi_square, degrees, parameters } = contradiction;
    let size = format!("chi-square is {chi_square:.0} for {degrees}");
    let differences = match parameters.as_deref() {
        None if *points < 3 => return format!("the locked point does not belong to this scene ({size})"),
        None => {
            return format!("the points do not belong to this scene ({size}), nor to one with other parameters");
        }
        Some([]) => format!("several parameters differ together ({size})"),
        Some(parameters) => {
            let texts = parameters.iter().map(|parameter| {
                let FittedParameter { symbol, unit, value, uncertainty, expected } = parameter;
                let value = with_unit(&format!("{value:.4e} ± {uncertainty:.1e}"), unit);
                format!("{symbol} = {value} fits, the scene says {expected:.4e}")
            });
            texts.collect::<Vec<String>>().join("; ")
        }
    };
    format!("the points do not belong to this scene: {differences}")
}

/// How often each regime occurs on a map.
pub(super) fn regimes(map: &Map) -> Table {
    let inside = map.cells.iter().filter(|cell| cell.theory_stable).count();
    let share = |count: usize, of: usize| (of > 0).then(|| format!("{:.1} %", 100.0 * count as f64 / of as f64));
    let rows = Regime::SIMULATED.into_iter().map(|regime| {
        let (all, stable) = map.count(regime);
        cells![regime.name(), all, share(all, map.cells.len()), share(stable, inside)]
    });
    Table::new("regime | cells | share | inside the theory's stable island").rows(rows)
}

/// What the symbols of an identification mean.
const SYMBOLS: &str = "  sigma: detuning (omega/omega0 - 1)/epsilon; C: amplitude of the response over b; B: particle speed over b omega0; G: base amplitude \
                       over b epsilon\n";

/// An identification: the locked point beside theory and exact orbit, then the decay. Of a rig that does not report impacts, only what is measured.
pub(super) fn identification(result: &Comparison, scene: &Scene) -> String {
    let (lock, at) = (&result.lock, &result.lock.at);
    let [hertz, response, drive] = values(at);
    let [(of_response, m), (of_drive, unit)] = channels(scene);
    let measured = format!("Measured: {hertz} Hz, {of_response} {response} {m}, {of_drive} {drive} {unit}\n");
    let under_drive = match lock.held {
        true => "",
        false => " (under a constant drive: the controller does not control the response)",
    };
    let locked = |motion: String| {
        format!(
            "Locked after {:.0} periods{under_drive}: {motion}, phase error {:.1e} ± {:.1e} degrees\n",
            lock.periods_to_lock, at.phase_error_deg, at.u_phase_deg
        )
    };
    if lock.regime_by_impacts.is_none() {
        let (locked, decay) = (locked(lock.regime.motion().into()), decay_at_sensor(result));
        let notes = [
            Some(stability(lock)),
            lock.clipped_percent.map(clipped),
            lock.tone.map(tone),
        ];
        return format!(
            "{measured}{locked}{}\n{decay}\n",
            lines(notes.into_iter().flatten().map(note))
        );
    }
    let name = match result.curve.is_of_structure {
        true => "driven mode alone, first order",
        false => "theory, first order",
    };
    let b = lock.b.zip(lock.u_b);
    let own = cells!["measured at the lock", (at.sigma, at.u_sigma), (at.c, at.u_c), b];
    let exact = result.exact.map(|one| cells!["exact orbit", one.sigma, one.c, one.b]);
    let theory = result.theory.map(|one| cells![name, one.sigma, one.c, one.b]);
    let table = Table::new(" | sigma | C | B").rows([Some(own), exact, theory].into_iter().flatten());
    let exact = result.exact.as_ref().map_or(String::new(), |Orbit { g, .. }| {
        lines([note(format!(
            "the exact orbit has the measured C, and the drive G = {g:.6}; theory is at the requested G"
        ))])
    });
    format!(
        "{measured}{}, G = {}\n{}\n{}{SYMBOLS}{exact}{}\n{}\n{}\n",
        rig(&result.parameters),
        with_uncertainty(at.g, at.u_g),
        locked(format!("{}, {}", lock.regime, lock.impacts())),
        table.text(),
        lines(notes(result).iter().map(note)),
        decay(result),
        agreement(result)
    )
}

/// What is to be said of a lock beside its numbers.
fn notes(result: &Comparison) -> Vec<String> {
    let (lock, at, asked) = (&result.lock, &result.lock.at, result.parameters.g);
    let mut notes = vec![stability(lock)];
    notes.extend(lock.friction.as_ref().map(friction_text));
    notes.extend(lock.clipped_percent.map(clipped));
    let left_out = result.left_out.as_ref();
    notes.extend(left_out.map(|left_out| ideal("theory and exact orbits are", left_out)));
    if result.exact.is_none() && result.theory.is_none() {
        notes.push(format!(
            "at the phase target, {} degrees, neither theory nor exact orbits have a motion to compare with",
            at.phase_target_deg
        ));
    }
    notes.extend(lock.tone.map(tone));
    // The curve is the one of the decay.
    let is_resonance = result.parameters.definition.is_phase_resonance();
    let smallest = result.curve.places().iter().map(|[_, _, g, _]| *g).reduce(f64::min);
    let fold = smallest.filter(|g| is_resonance && (at.g - g).abs() < SIGNIFICANT * at.u_g);
    notes.extend(fold.map(|g| {
        format!("the drive lies at the fold within its uncertainty: the smallest of the exact backbone is G = {g:.6}")
    }));
    if (at.g - asked).abs() > SIGNIFICANT * at.u_g {
        notes.push(format!("G = {asked} was asked for"));
    }
    if result.exact.is_none() && !result.orbits.is_empty() {
        notes.push("no exact orbit has the measured C".into());
    }
    notes.extend(result.others().map(|Orbit { sigma, c, b, .. }| {
        format!("another stable orbit at this G, not followed: sigma = {sigma:.4}, C = {c:.4}, B = {b:.4}")
    }));
    if result.exact.as_ref().is_some_and(Orbit::is_unstable) {
        notes.push("the exact orbit is unstable under a constant drive and frequency; the loop holds it".into());
    }
    notes
}

/// Up to which growth of a disturbance the lock is known to be stable.
fn stability(lock: &Lock) -> String {
    format!(
        "stability: over {} periods a disturbance would show that grows by {:.1} % per period or more; slower growth is not excluded",
        lock.averaged,
        100.0 * lock.unseen_growth
    )
}

fn clipped(share: f64) -> String {
    format!("before the release the amplifier was at its limit in {share:.1} % of the samples")
}

fn tone(tone: Tone) -> String {
    format!("{tone}: no part of the motion; check the cable of the sensor")
}

/// The decay, without a particle.
fn decay_at_sensor(result: &Comparison) -> String {
    let Some((first, last)) = result.decay.first().zip(result.decay.last()) else {
        return "Free decay: no points".into();
    };
    let (first, last) = (first.point, last.point);
    format!(
        "Free decay: {} points from {:.4e} m at {:.5} Hz down to {:.4e} m at {:.5} Hz",
        result.decay.len(),
        first.a_m,
        first.f_hz,
        last.a_m,
        last.f_hz
    )
}

/// That `results` of the ideal cavity leave something out.
pub(super) fn ideal(results: &str, left_out: &str) -> String {
    format!("{results} of the ideal cavity, without {left_out}")
}

/// Whose numbers the results of a structure are, as a line; empty for one oscillator. `reports_impacts`: whether there are dimensionless ones.
pub(super) fn structure(scene: &Scene, reports_impacts: bool) -> String {
    let Some(structure) = &scene.structure else {
        return String::new();
    };
    let masses = structure.mass_loading();
    let masses = masses.map_or(String::new(), |text| format!("{text}; all modes here are with them\n"));
    let numbers = match reports_impacts {
        true => "epsilon, lambda, sigma, C and G",
        false => "sigma, C and G in files",
    };
    let (Units { response, reference, .. }, d) = (structure.units(), scene.dimensionless());
    format!(
        "{masses}{numbers} are those of mode {}: C = 1 is a response of {:.5e}, and G = 1 a drive of {:.5e}\n",
        structure.driven + 1,
        response.quantity(d.b),
        reference.quantity(d.amplitude(1.0))
    )
}

/// In what the result is not the requested one.
pub(super) fn not_as_asked(result: &Comparison, scene: &Scene) -> impl Iterator<Item = String> {
    let lock = &result.lock;
    let [_, (of_drive, symbol)] = channels(scene);
    let (drive, requested) = (lock.at.drive(), lock.requested());
    let another = (!lock.at_requested_drive).then(|| {
        format!(
            "the result is at another drive than the requested one: {of_drive} {:.5e} ± {:.1e} {symbol}, {:.4} times the requested {requested:.5e} \
             {symbol}",
            drive.value,
            drive.uncertainty,
            drive.value / requested
        )
    });
    let after_release = result.base_after_release.or(result.force_after_release);
    let moves = after_release.map(|[value, u]| {
        format!(
            "there is no free decay: the drive was released, but the {of_drive} goes on with the drive's frequency, with at least {value:.2e} ± {u:.1e} \
             {symbol}, {:.1e} times the requested drive",
            value / requested
        )
    });
    [another, moves].into_iter().flatten()
}

/// What friction did, as a sentence.
fn friction_text(friction: &Friction) -> String {
    let Friction { sticks_per_period, stuck_time, loss } = friction;
    let sticking = if *sticks_per_period > 0.0 {
        format!("stuck to the floor {sticks_per_period:.3} times, for {stuck_time:.3e} s in all")
    } else {
        "never stuck to the floor".into()
    };
    format!("per period of the hold, friction took {loss:.3e} J, and the particle {sticking}")
}

fn decay(result: &Comparison) -> String {
    let end = match result.decay_end {
        DecayEnd::Synchrony => "where the impacts lose synchrony",
        DecayEnd::Linear => "where the impacts end",
        DecayEnd::Record => "where the record ends; a larger record.decay_periods shows more",
        DecayEnd::Driven => return "Free decay: no points, because the base goes on moving after the release".into(),
        DecayEnd::OtherMode => {
            return "Free decay: no points, because another mode moves freely after the release, too near the driven one to be told apart. Behind a \
                    shaker, short its coil (amplifier = \"voltage\"), or cut the stinger (release = \"cut\")"
                .into();
        }
    };
    match &result.decay[..] {
        [] => format!("Free decay: no points, because it is shorter than the window of the fit; it ends {end}"),
        points @ [first, ..] => format!(
            "Free decay: {} points from C = {:.4} down to {:.4}, {end}",
            points.len(),
            first.point.c,
            points[points.len() - 1].point.c
        ),
    }
}

fn agreement(result: &Comparison) -> String {
    let Some(rms) = result.rms_sigma_error else {
        return format!("No point of the decay lies above C = {COMPARED_ABOVE}");
    };
    let exact = result.rms_sigma_exact.zip(result.rms_sigma_slow_flow);
    let exact = exact.map_or(String::new(), |(raw, slow_flow)| {
        format!(
            "\nRMS of sigma against the exact backbone: {raw:.4}; against the decay of the slow flow: {slow_flow:.4}"
        )
    });
    let theory = match result.curve.is_of_structure {
        true => "theory of the driven mode alone",
        false => "theory",
    };
    format!(
        "RMS of sigma against {theory} over C > {COMPARED_ABOVE}: {rms:.4} (theory is of first order in epsilon){exact}"
    )
}

/// The points of a tracked backbone, and the periods that they took. Of a rig that does not report impacts, only what is measured.
pub(super) fn tracked(result: &TrackedComparison, scene: &Scene) -> String {
    let duration = format!(
        "{} points in {:.0} periods, {:.1} of which before the loop held the response: {:.1} periods per point\n",
        result.points.len(),
        result.periods,
        result.periods_to_lock,
        result.periods_per_point()
    );
    if !result.reports_impacts() {
        return format!(
            "{}\n{duration}{}",
            measured(result, scene),
            drive_harmonics(result, scene)
        );
    }
    let points = || result.points.iter();
    let rows = points().map(|TrackedPoint { point, exact }| {
        let at = &point.at;
        let by_impacts = point.regime_by_impacts.unwrap_or(Regime::Unknown);
        let error = exact.and_then(|exact| Some(exact.sigma?.abs().max(exact.g?.abs())));
        let [target, periods, averaged] = effort(point);
        let error = error.map(|error| format!("{error:.1e}"));
        let motion = remarks(point, format!("{} / {by_impacts}", point.regime), scene);
        let (c, sigma, g) = ((at.c, at.u_c), (at.sigma, at.u_sigma), (at.g, at.u_g));
        cells![c, sigma, g, target, periods, averaged, error, motion]
    });
    let headings = "C | sigma | G | off target | periods | averaged | error | regime by response / by impacts";
    let table = Table::new(headings).rows(rows);
    let worst = result.worst().map(|worst| {
        format!(
            "Largest error of a settled point, in sigma or G against the exact backbone at the same C: {:.1e} (distance from the nearest \
             place of the curve: {:.1e})",
            worst.at_equal_c, worst.nearest
        )
    });
    let hidden = points().map(|compared| &compared.point).filter(|point| {
        let regimes = (point.regime, point.regime_by_impacts);
        point.settled && regimes == (Regime::Symmetric, Some(Regime::Asymmetric))
    });
    let hidden = hidden.count();
    let hidden = (hidden > 0).then(|| {
        format!(
            "Settled points whose response looks symmetric, but whose impacts are asymmetric (not the symmetric backbone): {hidden}"
        )
    });
    let left_out = result.left_out.as_ref();
    let left_out = left_out.map(|left_out| format!("({})", ideal("the exact backbone is", left_out)));
    format!(
        "{}\n\n{}\n{duration}{}{}{}",
        rig(&result.parameters),
        table.text(),
        lines(worst),
        drive_harmonics(result, scene),
        lines(hidden.into_iter().chain(left_out))
    )
}

/// Distance from the phase target, and periods that a point took and that are averaged.
fn effort(point: &LevelPoint) -> [String; 3] {
    let error = point.at.phase_error_deg;
    [
        format!("{error:+.2}°"),
        format!("{:.1}", point.periods),
        point.averaged.to_string(),
    ]
}

/// What is to be said of a point beside its motion.
fn remarks(point: &LevelPoint, mut motion: String, scene: &Scene) -> String {
    if let Some(why) = point.unsettled(scene.knowledge().is_symmetric) {
        motion += &format!("; not settled: {why}");
    }
    if let Some(tone) = point.tone {
        motion += &format!("; {tone}");
    }
    motion
}

/// The measured points as a table, without a particle.
fn measured(result: &TrackedComparison, scene: &Scene) -> String {
    let rows = result.points.iter().map(|TrackedPoint { point, .. }| {
        let motion = remarks(point, point.regime.motion().into(), scene);
        [&values(&point.at)[..], &effort(point), &[motion]].concat()
    });
    let [response, drive] = channels(scene).map(|(name, unit)| format!("{name}, {unit}"));
    let headings = format!("frequency, Hz | {response} | {drive} | off target | periods | averaged | motion");
    Table::new(&headings).rows(rows).text()
}

/// Harmonics of what a shaker drives the structure with, as a table; empty without a shaker.
fn drive_harmonics(result: &TrackedComparison, scene: &Scene) -> String {
    let [(response, m), (drive, _)] = channels(scene);
    let rows = result.points.iter().filter_map(|TrackedPoint { point, .. }| {
        let harmonics = point
            .drive_harmonics?
            .map(|harmonic| format!("{:.3}", 100.0 * harmonic));
        let clipped = point.clipped_percent.map(|share| format!("{share:.1}"));
        let level = match result.reports_impacts() {
            true => format!("{:.4}", point.at.c),
            false => format!("{:.4e}", point.at.a_m),
        };
        Some([level].into_iter().chain(harmonics).chain(clipped).collect::<Vec<_>>())
    });
    let level = match result.reports_impacts() {
        true => "C",
        false => &format!("{response}, {m}"),
    };
    let headings = format!("{level} | 2, % | 3, % | 4, % | 5, % | 6, % | 7, % | clipped, %");
    let table = Table::new(&headings).rows(rows);
    table.text_under(&format!(
        "Harmonics of the {drive}, as measured, over its first, and share of the samples with the amplifier at its limit"
    ))
}
