//! Does the loop track the backbone of random structures through random shakers, and are the settled points on the exact orbits with that shaker?
//!
//! One to three modes as in `structures.rs`, a force at the drive point, and r 0.5 to 0.8. The armature has 0.001 to 0.5 of the modal mass at the drive
//! point; its suspension 0.3 to 3 times, and the stinger 3 to 30 times the natural frequency of the driven mode; the coil's damping Bl²/R is 0.03
//! to 54 times m omega0 of the armature, as published shakers have, its rate R/L 3 to 100 omega0 in half of the cases, and the amplifier controls the
//! voltage or the current (uniform logarithms).
//! Limits of voltage, current, stroke and force, unless LIMITS is `none`, are 1 to 100 times what the exact orbit at the first level needs, or as much more
//! as a scene needs that is not refused: a drive beyond one of them in more than the last sample is a failure.
//! Tracked in 8 levels over the range of responses in which the exact backbone with the shaker has stable orbits, at least a factor of 1.2. A point is right within 3 u of the exact backbone in sigma and G.
//!
//! With `lock` for LIMITS there are none, and the loop locks at the drive of the scene instead: is what `identify` says within 3 u of the exact backbone
//! at the same C, and if it does not lock, why? A shaker at a fixed drive may lock on an asymmetric motion, which is refused.
//!
//! Arguments: SHAKERS, SEED, LIMITS, `drawn`, `none` or `lock`, settings of the scene, `KEY=VALUE`, and the number of the only SHAKER to run, which writes
//! nothing. Writes validation/shakers.csv: a row per shaker; of locks validation/shaker_locks.csv: a row per seed and settings.

mod common;

use std::cell::Cell;
use std::rc::Rc;

use common::*;
use lovines::StructureState;
use vines_bench::rig::{RigError, RigStage, Sensors, SimulatedStructure};
use vines_bench::scene::{SceneShaker, Structure};
use vines_bench::survey::contradiction;

/// A structure with its shaker, and the dimensionless numbers of the shaker: mass ratio, suspension and stinger over omega0, coil.
fn text(uniform: Uniform) -> (String, [f64; 4]) {
    let mut log = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
    let (epsilon, lambda, r) = (log(0.003, 0.02), log(0.5, 2.0), log(0.5, 0.8));
    let (mut modes, mut ratio) = (Vec::new(), 1.0);
    let drive = log(0.1, 1.0);
    for n in 0..log(1.0, 4.0) as usize {
        let zeta = if n == 0 {
            0.5 * epsilon * lambda
        } else {
            log(0.003, 0.03)
        };
        let [cavity, other] = if n == 0 {
            [1.0, drive]
        } else {
            [log(0.1, 1.5), log(0.1, 1.5) * (log(1.0, 4.0) - 2.0).signum()]
        };
        modes.push(format!(
            "{{ frequency = {ratio:?}, damping = {zeta:?}, shape = {{ cavity = {cavity:?}, drive = {other:?} }} }}"
        ));
        ratio *= log(1.5, 5.0);
    }
    let [share, suspension, stinger, coil] = [log(0.001, 0.5), log(0.3, 3.0), log(3.0, 30.0), log(0.03, 54.0)];
    let (omega, mass) = (std::f64::consts::TAU, share / (drive * drive));
    let spring = |times: f64| mass * (times * omega).powi(2);
    let damped = |times: f64, zeta: f64| 2.0 * zeta * mass * times * omega;
    let inductance = if log(1.0, 4.0) < 2.0 {
        0.0
    } else {
        1.0 / (log(3.0, 100.0) * omega)
    };
    let amplifier = if log(1.0, 4.0) < 2.0 { "voltage" } else { "current" };
    let text = format!(
        "[plant]\nm = {epsilon:?}\nb = 1\nr = {r:?}\n[controller]\nomega_min = 0.8\nomega_max = 1.2\n[structure]\ncavity = \"cavity\"\n\
         excitation = \"force\"\ndrive = \"drive\"\nsensor = \"cavity\"\nmodes = [{}]\n[shaker]\nmass = {mass:?}\nstiffness = {:?}\ndamping = {:?}\n\
         stinger_stiffness = {:?}\nstinger_damping = {:?}\nresistance = 1\nBl = {:?}\ninductance = {inductance:?}\namplifier = \"{amplifier}\"\n",
        modes.join(", "),
        spring(suspension),
        damped(suspension, 0.02),
        spring(stinger),
        damped(stinger, 0.01),
        (coil * mass * omega).sqrt()
    );
    (text, [share, suspension, stinger, coil])
}

/// A scene with a drive at which a stable orbit exists, and its levels.
fn drawn(uniform: Uniform, limits: Option<Uniform>, settings: &[String]) -> Result<(Scene, [f64; 4]), Failure> {
    loop {
        let (text, numbers) = text(uniform);
        let share = uniform(0.0, 1.0);
        let plain = scene(&format!("{text}[excitation]\nG = 1\n"), &[""; 0])?;
        let Some(curves) = structure_backbone(&plain, &plain.dimensionless()) else {
            continue;
        };
        let all: Vec<Orbit> = curves.into_iter().flatten().collect();
        let is_level = |orbit: &&Orbit| orbit.stable && (0.85..=1.15).contains(&orbit.omega) && orbit.b < 1.35;
        let (low, high) = range((f64::INFINITY, 0.0), all.iter().filter(is_level).map(|orbit| orbit.c));
        let [from, to] = [0.95 * high.min(1.0), 1.1 * low];
        let drives = all
            .iter()
            .filter(is_level)
            .filter(|orbit| (to..=from).contains(&orbit.c))
            .map(|orbit| orbit.g);
        let (least, largest) = range((f64::INFINITY, 0.0), drives);
        if from < 1.2 * to || !(least..=3.0).contains(&largest) {
            continue;
        }
        let g = least + share * (largest - least);
        let rest = format!(
            "[excitation]\nG = {g:?}\n[start]\ndq2 = 5\n[backbone]\nC_from = {from:?}\nC_to = {to:?}\npoints = 8\n"
        );
        let bare = scene(&format!("{text}{rest}"), settings)?;
        let Some(limits) = limits else {
            return Ok((bare, numbers));
        };
        let mut shares = [0; 4].map(|_| limits(0.0, 100_f64.ln()).exp());
        let distance = |orbit: &&Orbit| (orbit.c - from).abs();
        let levels = all.iter().filter(is_level);
        let top = levels.min_by(|one, other| distance(one).total_cmp(&distance(other)));
        let needed = needed(&bare, top.map_or(1.0, |top| top.omega))?;
        // What needs more at its smallest response with impacts is refused.
        for _ in 0..20 {
            let [voltage, current, stroke, force] = [0, 1, 2, 3].map(|n| shares[n] * needed[n]);
            // An inductance has no voltage where the current jumps.
            let voltage = match text.contains("\"current\"") && !text.contains("inductance = 0\n") {
                true => String::new(),
                false => format!("voltage_max = {voltage:?}\n"),
            };
            let limits =
                format!("{voltage}current_max = {current:?}\nstroke_max = {stroke:?}\nforce_max = {force:?}\n");
            if let Ok(scene) = scene(&format!("{text}{limits}{rest}"), settings) {
                return Ok((scene, numbers));
            }
            shares = shares.map(|share| 1.5 * share);
        }
        return Err("a drive that no limits allow".into());
    }
}

/// Voltage, current, stroke and force now.
fn now(structure: &Structure, plant: &lovines::Plant<lovines::Structure>) -> [f64; 4] {
    let Some(SceneShaker { rows, .. }) = &structure.shaker else {
        return [0.0; 4];
    };
    let command = plant.base_displacement();
    [
        (&rows.voltage, rows.voltage_per_command),
        (&rows.current, rows.current_per_command),
        (&rows.armature, 0.0),
        (&rows.force, 0.0),
    ]
    .map(|(row, per_command)| (plant.point(row)[0] + per_command * command).abs())
}

/// Largest voltage, current, stroke and force of the exact orbits at phase resonance at a frequency, over omega0.
fn needed(scene: &Scene, omega: f64) -> Result<[f64; 4], Failure> {
    let structure = scene.structure.as_ref().ok_or("no structure")?;
    let (orbits, omega0) = (scene.orbits_of(structure), scene.dimensionless().omega0);
    let mut largest = [0.0_f64; 4];
    for orbit in orbits.at_phase_resonance(omega * omega0) {
        let mut plant = lovines::Plant::with_host(structure.host.clone(), scene.plant, &StructureState::default())?;
        let drive = lovines::Drive::harmonic(orbit.drive, orbit.omega);
        plant.begin(drive)?;
        plant.set_sections(&orbit.start.sections, [orbit.start.q2, orbit.start.dq2])?;
        for _ in 0..200 {
            plant.advance(drive, std::f64::consts::PI / orbit.omega / 100.0)?;
            let now = now(structure, &plant);
            largest = [0, 1, 2, 3].map(|n| largest[n].max(now[n]));
        }
    }
    Ok(largest)
}

/// A simulated shaker, and the samples at which it was driven beyond a limit.
struct Watched {
    rig: SimulatedStructure,
    structure: Structure,
    beyond: Rc<Cell<usize>>,
}

impl RigStage for Watched {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        let limits = self.structure.shaker.as_ref().map(|shaker| shaker.limits);
        let limits = limits.map_or([None; 4], |limits| {
            [limits.voltage, limits.current, limits.stroke, limits.force]
        });
        let now = now(&self.structure, self.rig.plant());
        let is_beyond = |n: usize| limits[n].is_some_and(|limit| now[n] > limit * (1.0 + 1e-9));
        self.beyond.set(self.beyond.get() + usize::from((0..4).any(is_beyond)));
        self.rig.sense()
    }
}

/// Largest error of a point in sigma and G over its u, from the orbit at the same response on any of the curves.
fn distance(curves: &[Vec<Orbit>], at: &ResonancePoint, plan: &Plan) -> f64 {
    // All detunings share the uncertainty of the natural frequency.
    let shared = plan.knowledge.linear.uncertainty / plan.knowledge.numbers.omega_change(1.0);
    off_backbone(curves, at, shared)[1]
}

/// Points, settled ones, those beyond 3 u, the largest error over u, periods, why it ended, and [`contradicted`].
type Run = (usize, usize, usize, f64, f64, String, [Option<bool>; 4]);

fn run((scene, _): &(Scene, [f64; 4])) -> Run {
    let none = |why: String| (0, 0, 0, f64::NAN, f64::NAN, why, [None; 4]);
    let stated = scene.plan();
    let checked = Simulated::of(&scene.clone().at_rest()).and_then(|mut rig| check(&mut *rig, &stated));
    let linear = match checked {
        Ok(checked) => match checked.linear {
            Some(linear) => linear.response,
            None => return none(format!("refused by the check, {}", checked.verdict)),
        },
        Err(error) => return none(error.to_string()),
    };
    let plan = scene.plan_on(stated.knowledge.measured(linear));
    let Some(structure) = scene.structure.clone() else {
        return none("no structure".into());
    };
    let rig = match SimulatedStructure::new(&structure, scene.plant, scene.start) {
        Ok(rig) => rig,
        Err(error) => return none(error.to_string()),
    };
    let beyond = Rc::default();
    let rig = Watched { rig, structure, beyond: Rc::clone(&beyond) };
    let tracked = tracked(&mut *Chain::around(Box::new(rig), scene), &plan, 20.0);
    if beyond.get() > 1 {
        return none(format!("driven beyond a limit in {} samples", beyond.get()));
    }
    let tracked = match tracked {
        Ok(tracked) => tracked,
        Err(error) => return none(error.to_string()),
    };
    let curves = structure_backbone(scene, &scene.dimensionless()).unwrap_or_default();
    let (mut settled, mut beyond, mut worst) = (0, 0, 0.0);
    for LevelPoint { at, .. } in kept(&tracked) {
        settled += 1;
        let ratio = distance(&curves, at, &plan);
        worst = ratio.max(worst);
        beyond += usize::from(ratio > 3.0);
    }
    for point in tracked.points.iter().filter(|_| std::env::var("POINTS").is_ok()) {
        println!("{point:?}");
    }
    let mut why = tracked.ended.as_ref().map_or_else(String::new, ToString::to_string);
    if why.is_empty() && 2 * settled < tracked.points.len() {
        let reason = |point: &LevelPoint| point.unsettled(plan.knowledge.is_symmetric);
        why = tracked
            .points
            .iter()
            .find_map(reason)
            .unwrap_or_else(|| "motions without impacts".into());
    }
    let contradicted = contradicted(scene, &tracked);
    (
        tracked.points.len(),
        settled,
        beyond,
        worst,
        tracked.periods,
        why,
        contradicted,
    )
}

/// Whether `vines backbone` says that the points do not belong to the scene, and to scenes with another r, b or m; `None` of a backbone that ended early.
fn contradicted(scene: &Scene, tracked: &Tracked) -> [Option<bool>; 4] {
    let points: Vec<_> = kept(tracked).map(|point| point.at.measured(&scene.units())).collect();
    let alter: [fn(&mut Parameters); 4] = [
        |_| (),
        |plant| plant.restitution -= 0.05,
        |plant| plant.half_width *= 1.03,
        |plant| plant.particle_mass *= 1.05,
    ];
    alter.map(|alter| {
        let mut scene = scene.clone();
        alter(&mut scene.plant);
        let is_whole = tracked.ended.is_none() && points.len() >= 4;
        is_whole.then(|| contradiction(&scene, points.clone()).is_some())
    })
}

/// Error of the lock over its u, and periods to the lock; or why there is none.
fn locked((scene, _): &(Scene, [f64; 4])) -> Result<[f64; 2], String> {
    let stated = scene.plan();
    let mut rig = Simulated::of(&scene.clone().at_rest()).map_err(|error| error.to_string())?;
    let checked = check(&mut *rig, &stated).map_err(|error| error.to_string())?;
    let linear = checked
        .linear
        .ok_or_else(|| format!("refused by the check, {}", checked.verdict))?;
    let plan = scene.plan_on(stated.knowledge.measured(linear.response));
    let mut rig = Simulated::of(scene).map_err(|error| error.to_string())?;
    let record = record(&mut *rig, &plan).map_err(|error| error.to_string())?;
    let lock = identify(&record, &plan).map_err(|error| error.to_string())?.lock;
    let curves = structure_backbone(scene, &scene.dimensionless()).unwrap_or_default();
    Ok([distance(&curves, &lock.at, &plan), lock.periods_to_lock])
}

/// Rows of locks.
fn locks(seed: &str, settings: &[String], scenes: &[(Scene, [f64; 4])]) -> Result<(), Failure> {
    let found: Vec<_> = scenes.par_iter().map(locked).collect();
    for (n, found) in found.iter().enumerate() {
        match found {
            Ok([ratio, periods]) => println!("{n}: {ratio:.2} u after {periods:.0} periods"),
            Err(why) => println!("{n}: {why}"),
        }
    }
    let values = |n: usize| found.iter().flatten().map(|values| values[n]).collect::<Vec<f64>>();
    let (ratios, [median, longest]) = (values(0), ends(&values(1)));
    let beyond = ratios.iter().filter(|ratio| **ratio > 3.0).count();
    let counted = |words: &str| {
        found
            .iter()
            .flat_map(|one| one.as_ref().err())
            .filter(|why| why.contains(words))
            .count()
    };
    let [refused, asymmetric, unsteady, timed_out] = [
        "refused by the check",
        "but the regime is",
        "is not steady",
        "no lock within",
    ]
    .map(counted);
    let header = "seed,settings,shakers,locked,beyond_3u,worst_u,median_periods,longest,refused_by_check,asymmetric,not_steady,timed_out,others";
    let others = scenes.len() - ratios.len() - refused - asymmetric - unsteady - timed_out;
    let row = format!(
        "{seed},{},{},{},{beyond},{:.2},{median:.0},{longest:.0},{refused},{asymmetric},{unsteady},{timed_out},{others}",
        settings.join(" "),
        scenes.len(),
        ratios.len(),
        ends(&ratios)[1]
    );
    write("shaker_locks", header, 2, &[row])
}

fn main() -> Result<(), Failure> {
    let given = std::env::args().skip(1);
    let (settings, given): (Vec<String>, Vec<String>) = given.partition(|one| one.contains('='));
    let [count, seed, kind, only @ ..] = &given[..] else {
        return Err("arguments: SHAKERS SEED LIMITS [SHAKER] [KEY=VALUE ...]".into());
    };
    if !["drawn", "none", "lock"].contains(&&kind[..]) {
        return Err(format!("limits {kind}: drawn, none or lock").into());
    }
    let seed_of_limits = !seed.parse::<u64>()?;
    let [mut uniform, mut limits] = [seed.parse()?, seed_of_limits].map(uniform);
    let scenes: Vec<_> = (0..count.parse()?)
        .map(|_| {
            let limits: Option<Uniform> = if kind == "drawn" { Some(&mut limits) } else { None };
            drawn(&mut uniform, limits, &settings)
        })
        .collect::<Result<_, _>>()?;
    if kind == "lock" {
        let [only] = only else {
            return locks(seed, &settings, &scenes);
        };
        println!("{:?}", locked(&scenes[only.parse::<usize>()?]));
        return Ok(());
    }
    if let [only] = only {
        let (points, settled, beyond, worst, periods, why, _) = run(&scenes[only.parse::<usize>()?]);
        println!(
            "{points} points, {settled} settled, {beyond} beyond 3 u, worst {worst:.2} u, {periods:.0} periods; {why}"
        );
        return Ok(());
    }
    let found: Vec<_> = scenes.par_iter().map(run).collect();
    let rows: Vec<_> = scenes.iter().zip(&found).enumerate().map(|(n, ((scene, numbers), found))| {
        let [share, suspension, stinger, coil] = numbers;
        let drop_out = scene.knowledge().shaker.map_or(f64::NAN, |shaker| shaker.drop_out());
        let bandwidth = scene.plan().tracking.bandwidth / std::f64::consts::TAU;
        let (points, settled, beyond, worst, periods, why, _) = found;
        format!(
            "{seed},{kind},{n},{share:.4},{suspension:.3},{stinger:.2},{coil:.3},{drop_out:.4},{bandwidth:.4},{points},{settled},{beyond},{worst:.2},{periods:.0},\"{}\"",
            why.split([';', '"']).next().and_then(|why| why.split(": ").next()).unwrap_or_default()
        )
    }).collect();
    let tracked = found.iter().filter(|one| one.1 >= 4 && one.2 == 0).count();
    let wrong: usize = found.iter().map(|one| one.2).sum();
    let settled: usize = found.iter().map(|one| one.1).sum();
    let counted = |words: &str| found.iter().filter(|one| one.5.contains(words)).count();
    let [refused, beyond] = ["refused", "driven beyond"].map(counted);
    let limited = found.iter().filter(|one| one.1 < 4 && one.5.contains(" limit")).count();
    let silent = found.iter().filter(|one| one.1 < 4 && one.5.is_empty()).count();
    println!(
        "{refused} refused by the check; {tracked} of {count} tracked with at least half of the levels settled and none beyond 3 u; {wrong} of {settled} settled points beyond 3 u; \
         of the others {limited} end at a limit, {silent} without a reason; {beyond} driven beyond a limit"
    );
    let [false_alarms, r, b, m] = [0, 1, 2, 3].map(|n| found.iter().filter(|one| one.6[n] == Some(true)).count());
    let whole = found.iter().filter(|one| one.6[0].is_some()).count();
    println!(
        "the points of {false_alarms} of {whole} backbones contradict their scene; of scenes with another r {r}, b {b}, m {m} are noticed"
    );
    let header = "seed,limits,shaker,mass_ratio,suspension,stinger,coil,drop_out,bandwidth,points,settled,beyond_3u,worst_u,periods,ended";
    write("shakers", header, 3, &rows)
}
