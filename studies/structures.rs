//! Do random structures lock from rest on an exact orbit of their drive?
//!
//! One to five modes; the driven one has a mass ratio of 0.002 to 0.02 and lambda of 0.1 to 3, as in `locks.rs`, the others 1.1 to 20 times its
//! frequency, damping ratios of 0.001 to 0.03, and shapes of either sign up to 1.5 times the driven one's (uniform logarithms). A base or a
//! force, the sensor at the drive or at the cavity, r 0.3 to 0.9, and G at most 4, the largest drive of a tracked backbone. Half of the drives
//! are of a stable symmetric 1:1 orbit at phase resonance; at the others all orbits are unstable.
//!
//! Control holds the response. `stable` and `unstable` count locks with such an orbit, at a fixed frequency and drive, within 2e-3 of the measured
//! drive, and within 2e-3 in sigma and C, or within 3 u; `other_drive` those of which the result says that the drive is not the requested one. `wrong` are
//! near no orbit. Orbits may be stable where no phase loop, which has integral action, can hold them: where, under a constant drive, the response lags less
//! at a higher frequency. The words on a structure say where this is so, and their number counts refusals at such orbits alone.
//!
//! Arguments: STRUCTURES (of each kind), SEED. Writes validation/structures.csv. With `stable` or `unstable` it runs this kind alone; with numbers of
//! structures behind it these alone: it then says what the loop did, and writes nothing.

mod common;

use common::*;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use vines_bench::advice::can_be_held;
use vines_bench::survey::phase_resonant as orbits_of;

/// Largest error of a correct lock: in sigma and C, and of the drive, relative.
const TOLERANCE: f64 = 2e-3;
/// Intervals into which the exact backbone is divided between two orbits.
const FINE: usize = 20;

/// What became of a structure.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Outcome {
    Stable,
    Unstable,
    OtherDrive,
    Wrong,
    Refused,
}

/// A structure with the drive G: its text as a scene.
fn text(uniform: &mut dyn FnMut(f64, f64) -> f64) -> String {
    let mut log = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
    let (epsilon, lambda, count) = (log(0.002, 0.02), log(0.1, 3.0), log(1.0, 6.0).floor() as usize);
    let mut modes = Vec::new();
    let mut ratio = 1.0;
    let is_base = log(1.0, 4.0) < 2.0;
    for n in 0..count {
        let zeta = if n == 0 {
            0.5 * epsilon * lambda
        } else {
            log(0.001, 0.03)
        };
        let mut shape = || {
            if n == 0 {
                log(0.5, 1.5)
            } else {
                log(0.1, 1.5) * (log(1.0, 4.0) - 2.0).signum()
            }
        };
        let (cavity, other) = (if n == 0 { 1.0 } else { shape() }, shape());
        let participation = if is_base {
            format!("participation = {other:?}, ")
        } else {
            String::new()
        };
        modes.push(format!(
            "{{ frequency = {ratio:?}, damping = {zeta:?}, {participation}shape = {{ cavity = {cavity:?}, drive = {other:?} }} }}"
        ));
        ratio *= log(1.1, 4.0);
    }
    let (drive, sensor) = match (is_base, log(1.0, 4.0) < 2.0) {
        (true, _) => ("excitation = \"base\"", "cavity"),
        (false, true) => ("excitation = \"force\"\ndrive = \"drive\"", "drive"),
        (false, false) => ("excitation = \"force\"\ndrive = \"drive\"", "cavity"),
    };
    let r = log(0.3, 0.9);
    format!(
        "[plant]\nm = {epsilon:?}\nb = 1\nr = {r:?}\n[controller]\nomega_min = 0.8\nomega_max = 1.2\n[record]\ndecay_periods = 3\n[structure]\n\
         cavity = \"cavity\"\n{drive}\nsensor = \"{sensor}\"\nmodes = [{}]\n",
        modes.join(", ")
    )
}

/// A scene with a drive at which a stable orbit exists, or only unstable ones.
fn scene_with(is_stable: bool, uniform: &mut dyn FnMut(f64, f64) -> f64) -> Result<Scene, Failure> {
    loop {
        let text = text(uniform);
        let share = uniform(0.0, 1.0);
        let plain = scene(&format!("{text}[excitation]\nG = 1\n"), &[""; 0])?;
        let d = plain.dimensionless();
        let curves = structure_backbone(&plain, &d).ok_or("no structure")?;
        let found: Vec<Orbit> = curves.into_iter().flatten().collect();
        let of_kind = found
            .iter()
            .filter(|orbit| orbit.stable == is_stable && (0.8..=1.2).contains(&orbit.omega) && orbit.g <= 4.0);
        let of_kind: Vec<&Orbit> = of_kind.collect();
        let Some(orbit) = of_kind.get((share * of_kind.len() as f64) as usize) else {
            continue;
        };
        let driven = scene(&format!("{text}[excitation]\nG = {:?}\n", orbit.g), &[""; 0])?;
        let orbits = orbits_of(&driven, &d);
        if !orbits.is_empty() && orbits.iter().any(|orbit| orbit.stable) == is_stable {
            return Ok(driven);
        }
    }
}

/// Locks a structure: what became of it, its errors in sigma and C, its periods, and what was found.
fn lock(scene: &Scene) -> (Outcome, [f64; 2], f64, String) {
    let locked = || -> Result<_, Failure> {
        let plan = scene.plan();
        let record = record(&mut *Simulated::of(scene)?, &plan)?;
        let found = identify(&record, &plan)?;
        Ok((record, found))
    };
    let (record, found) = match locked() {
        Ok(both) => both,
        Err(error) => return (Outcome::Refused, [f64::NAN; 2], f64::NAN, error.to_string()),
    };
    let at = found.lock.at;
    let periods = record.settled as f64 / scene.controller.samples_per_period;
    let d = scene.dimensionless();
    let largest = |errors: [f64; 2]| errors[0].max(errors[1]);
    // Of the orbit that is nearest to the lock: its errors.
    let nearest = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let errors = points.map(|[sigma, c]| [(at.sigma - sigma).abs(), (at.c - c).abs()]);
        let nearest = errors.min_by(|one, other| largest(*one).total_cmp(&largest(*other)));
        nearest.unwrap_or([f64::INFINITY; 2])
    };
    let errors_of = |stable: bool| {
        let curves = structure_backbone(scene, &d).unwrap_or_default();
        let pairs = curves.iter().flat_map(|curve| curve.windows(2));
        let points = pairs
            .filter(|pair| pair.iter().any(|orbit| orbit.stable == stable))
            .flat_map(|pair| {
                let [a, b] = [&pair[0], &pair[1]].map(|orbit| [orbit.sigma, orbit.c, orbit.g]);
                (0..=FINE).map(move |n| [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * n as f64 / FINE as f64))
            });
        let near = points.filter(|point| (point[2] / at.g - 1.0).abs() <= TOLERANCE);
        nearest(&mut near.map(|[sigma, c, _]| [sigma, c]))
    };
    let is_right =
        |errors: [f64; 2]| largest(errors) <= TOLERANCE || (errors[0] <= 3.0 * at.u_sigma && errors[1] <= 3.0 * at.u_c);
    let [stable, unstable] = [true, false].map(errors_of);
    let errors = if is_right(stable) || largest(stable) < largest(unstable) {
        stable
    } else {
        unstable
    };
    let outcome = match (is_right(stable), is_right(unstable)) {
        (false, false) => Outcome::Wrong,
        _ if !found.lock.at_requested_drive => Outcome::OtherDrive,
        (true, _) => Outcome::Stable,
        _ => Outcome::Unstable,
    };
    let found = format!(
        "sigma {:.5} +- {:.5}, C {:.5} +- {:.5}, G {:.5} of {:.5}, {}",
        at.sigma, at.u_sigma, at.c, at.u_c, at.g, d.g, found.lock.regime
    );
    (outcome, errors, periods, found)
}

/// Whether a phase loop can hold a stable orbit under the drive of a scene.
fn is_lockable(scene: &Scene) -> bool {
    let d = scene.dimensionless();
    orbits_of(scene, &d)
        .iter()
        .any(|orbit| orbit.stable && can_be_held(scene, &d, orbit))
}

/// The orbits under the drive of a scene, and where those of its backbone are stable.
fn orbits_in_words(scene: &Scene) -> String {
    let d = scene.dimensionless();
    let said = |orbit: &Orbit| {
        let Orbit { sigma, c, g, b, .. } = *orbit;
        format!(
            "sigma {sigma:.4} C {c:.4} G {g:.4} B {b:.3} growth {:.4}; ",
            orbit.multipliers[3]
        )
    };
    let mut words = format!("{d:?}\n  under the drive: ");
    words.extend(orbits_of(scene, &d).iter().map(said));
    for curve in structure_backbone(scene, &d).unwrap_or_default() {
        for run in curve.chunk_by(|one, other| one.stable == other.stable) {
            words += if run[0].stable {
                "\n  stable: "
            } else {
                "\n  unstable: "
            };
            words.extend([&run[0], &run[run.len() / 2], &run[run.len() - 1]].map(said));
        }
    }
    words + &format!("\n  {:?}", scene.structure.as_ref().map(|structure| &structure.modes))
}

fn main() -> Result<(), Failure> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [count, seed, only @ ..] = &given[..] else {
        return Err("arguments: STRUCTURES SEED [stable|unstable [NUMBER...]]".into());
    };
    let (count, seed): (usize, u64) = (count.parse()?, seed.parse()?);
    let mut rows = Vec::new();
    for is_stable in [true, false] {
        let kind = if is_stable { "stable" } else { "unstable" };
        if only.first().is_some_and(|only| only != kind) {
            continue;
        }
        let mut uniform = uniform(seed + u64::from(is_stable));
        let scenes = (0..count).map(|_| scene_with(is_stable, &mut uniform));
        let mut scenes: Vec<_> = scenes
            .collect::<Result<Vec<_>, Failure>>()?
            .into_iter()
            .enumerate()
            .collect();
        scenes.retain(|(n, _)| only.len() < 2 || only.contains(&n.to_string()));
        let found: Vec<_> = scenes.par_iter().map(|(_, scene)| lock(scene)).collect();
        for ((n, scene), (outcome, errors, periods, found)) in scenes.iter().zip(&found) {
            if *outcome != Outcome::Stable || only.len() > 1 {
                println!(
                    "{kind} {n}: {outcome:?}, errors {:.1e} and {:.1e}, {periods:.0} periods: {found}",
                    errors[0], errors[1]
                );
                println!(
                    "  a phase loop can hold one: {}; {}",
                    is_lockable(scene),
                    orbits_in_words(scene)
                );
            }
        }
        let refused = scenes
            .iter()
            .zip(&found)
            .filter(|(_, (outcome, ..))| *outcome == Outcome::Refused);
        let hopeless = refused
            .filter(|((_, scene), _)| is_stable && !is_lockable(scene))
            .count();
        println!("{kind}: refused where no phase loop can hold a stable orbit: {hopeless}");
        if only.len() > 1 {
            continue;
        }
        let of = |wanted: Outcome| found.iter().filter(|(outcome, ..)| *outcome == wanted).count();
        let kinds = [
            Outcome::Stable,
            Outcome::Unstable,
            Outcome::OtherDrive,
            Outcome::Wrong,
            Outcome::Refused,
        ]
        .map(of);
        let finite = |mut values: Vec<f64>| {
            values.retain(|value| value.is_finite());
            ends(&values)
        };
        let errors = finite(found.iter().flat_map(|(_, errors, ..)| *errors).collect());
        let periods = finite(found.iter().map(|(_, _, periods, _)| *periods).collect());
        let kinds = kinds.map(|count| count.to_string()).join(",");
        rows.push(format!(
            "{count},{seed},{kind},{kinds},{:.1e},{:.1e},{:.0},{:.0}",
            errors[0], errors[1], periods[0], periods[1]
        ));
    }
    if rows.is_empty() {
        return Ok(());
    }
    let header = "structures,seed,orbits,stable,unstable,other_drive,wrong,refused,median_error,worst_error,median_periods,worst_periods";
    write("structures", header, 3, &rows)
}
