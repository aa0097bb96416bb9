//! Guards the exact orbits of structures against the plant: random structures, started on an orbit, stay on it where it is stable, and leave it
//! at the rate of the largest multiplier where it is not.
//!
//! `STRUCTURES=2000 SEED=7 cargo test --release -p vines-model --test structure_motions -- --nocapture` prints validation/structure_orbits.csv.

use std::f64::consts::{FRAC_PI_2, TAU};

use lovines::host::Equations;
use lovines::{Cavity, Drive, Excitation, Host, Mode, Parameters, Plant, Structure, StructureState};
use nalgebra::{Complex, DMatrix, DVector};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};
use vines_model::orbit::{Particle, StructureOrbit, StructureOrbits};

mod common;
use common::{setting, within};

/// Periods that a stable orbit is followed, and most periods of an unstable one.
const PERIODS: usize = 200;
/// Disturbance of an unstable orbit, and the distance at which its departure is no longer linear; over the size of the motion.
const DISTURBED: f64 = 1e-7;
const FAR: f64 = 1e-5;
/// Step of the central differences, over the size of the motion.
const STEP: f64 = 1e-6;
/// Growth over a period from which disturbance and step are smaller, so that they are small after a period.
const FAST: f64 = 100.0;

/// A structure with a particle, and what kind it is.
struct Rig {
    kind: &'static str,
    host: Host,
    particle: Particle,
    orbits: StructureOrbits,
    /// The section whose backbone is followed.
    driven: usize,
}

fn pick(random: &mut ChaCha8Rng, count: usize) -> usize {
    (random.next_u64() % count as u64) as usize
}

fn signed(random: &mut ChaCha8Rng, range: [f64; 2]) -> f64 {
    let size = within(random, range);
    if random.next_u64().is_multiple_of(2) {
        size
    } else {
        -size
    }
}

/// A power of ten with an exponent in a range.
fn power(random: &mut ChaCha8Rng, exponents: [f64; 2]) -> f64 {
    10_f64.powf(within(random, exponents))
}

/// 1 to 8 real modes with frequency ratios up to 30 and damping ratios up to 0.2.
fn by_modes(random: &mut ChaCha8Rng, excitation: Excitation) -> Host {
    let count = 1 + pick(random, 8);
    let mut mode = |ratio: f64| Mode {
        omega: 50.0 * ratio,
        zeta: power(random, [-3.0, -0.7]),
        cavity: signed(random, [0.1, 1.0]),
        drive: signed(random, [0.1, 1.0]),
    };
    let mut modes = vec![mode(1.0)];
    for n in 1..count {
        let share = within(random, [0.003, 1.0]) * n as f64 / count as f64;
        let zeta = power(random, [-3.0, -0.7]);
        let [cavity, drive] = [0, 1].map(|_| signed(random, [0.1, 1.0]));
        modes.push(Mode { omega: 50.0 * 30_f64.powf(share), zeta, cavity, drive });
    }
    Host::from_modes(excitation, &modes).unwrap()
}

/// A chain of 2 to 5 masses with dashpots that are not proportional to masses and springs.
fn by_matrices(random: &mut ChaCha8Rng, excitation: Excitation) -> Host {
    let count = 2 + pick(random, 4);
    let mut matrix = |range: [f64; 2], coupled: bool| {
        let mut rows = vec![vec![0.0; count]; count];
        for n in 0..count {
            rows[n][n] += power(random, range);
            if coupled && n > 0 {
                let between = power(random, range);
                rows[n][n] += between;
                rows[n - 1][n - 1] += between;
                rows[n][n - 1] -= between;
                rows[n - 1][n] -= between;
            }
        }
        rows
    };
    let mass = matrix([-0.3, 0.3], false);
    let stiffness = matrix([3.0, 4.5], true);
    let damping = matrix([-0.5, 0.9], true);
    let unit = |n: usize| {
        (0..count)
            .map(|other| f64::from(u8::from(other == n)))
            .collect::<Vec<_>>()
    };
    let cavity = unit(pick(random, count));
    let drive = match excitation {
        Excitation::Base => vec![1.0; count],
        Excitation::Force => unit(pick(random, count)),
    };
    let equations = Equations::Matrices { mass, damping, stiffness, cavity, drive, states: vec![] };
    equations.host(excitation).unwrap()
}

/// A random structure. The particle has 0.1 to 3 % of the modal mass of the driven mode.
fn rig(random: &mut ChaCha8Rng) -> Rig {
    let excitation = [Excitation::Base, Excitation::Force][pick(random, 2)];
    let is_modal = pick(random, 3) > 0;
    let host = if is_modal {
        by_modes(random, excitation)
    } else {
        by_matrices(random, excitation)
    };
    let kind = match (is_modal, excitation) {
        (true, Excitation::Base) => "real modes on a base",
        (true, Excitation::Force) => "real modes under a force",
        (false, Excitation::Base) => "complex modes on a base",
        (false, Excitation::Force) => "complex modes under a force",
    };
    let driven = pick(random, host.sections().len());
    let section = host.sections()[driven];
    // The share of a complex mode may be negative: such a structure has no first-order theory, and is left out.
    let mass = power(random, [-3.0, -1.5]) / section.velocity_per_impulse(section.cavity).abs();
    let restitution = within(random, [0.3, 0.95]);
    let particle = Particle { mass, half_width: 0.01, restitution };
    let mut orbits = StructureOrbits::new(&host, particle);
    // Half of the structures are measured at another point, with another phase.
    if pick(random, 2) == 0 {
        let point: Vec<f64> = host.sections().iter().map(|_| signed(random, [0.1, 1.0])).collect();
        let phase = within(random, [-2.0 * FRAC_PI_2, 0.0]);
        orbits = orbits.with_response(&host.row(&point).unwrap()).with_target(phase);
    }
    Rig { kind, host, particle, orbits, driven }
}

/// A plant beside an orbit, and the state there.
struct Motion<'a> {
    rig: &'a Rig,
    drive: Drive,
    plant: Plant<Structure>,
    /// Sizes of displacements and velocities.
    scale: [f64; 2],
}

impl<'a> Motion<'a> {
    /// The plant on the orbit, in the middle of a flight.
    fn on(rig: &'a Rig, orbit: &StructureOrbit) -> Self {
        let parameters = Parameters {
            primary_mass: 1.0,
            stiffness: 1.0,
            damping: 0.0,
            particle_mass: rig.particle.mass,
            half_width: rig.particle.half_width,
            restitution: rig.particle.restitution,
            cavity: Cavity::IDEAL,
        };
        let start = &orbit.start;
        let rest = vec![0.0; start.sections.len()];
        let rest = StructureState {
            displacements: rest.clone(),
            velocities: rest,
            q2: 0.0,
            dq2: 0.0,
        };
        let drive = Drive::harmonic(orbit.drive, orbit.omega);
        let mut plant = Plant::with_host(rig.host.clone(), parameters, &rest).unwrap();
        plant.begin(drive).unwrap();
        plant.set_sections(&start.sections, [start.q2, start.dq2]).unwrap();
        let half = 0.5 * TAU / orbit.omega;
        let middle = (orbit.impact_phase / orbit.omega + 0.5 * half).rem_euclid(half);
        plant.advance(drive, middle).unwrap();
        let mut motion = Self { rig, drive, plant, scale: [1.0; 2] };
        let state = motion.state();
        motion.scale = [0, 1].map(|part| {
            state
                .iter()
                .skip(part)
                .step_by(2)
                .fold(0.0, |size: f64, x| size.max(x.abs()))
        });
        // The displacement of the particle is zero there.
        motion.scale[0] = motion.scale[0].max(rig.particle.half_width);
        motion
    }

    /// Displacements and velocities of the coordinates and the particle, in turn, over their sizes.
    fn state(&self) -> DVector<f64> {
        let count = self.rig.host.sections().len();
        let mut state = Vec::new();
        for n in 0..count {
            let unit: Vec<f64> = (0..count).map(|other| f64::from(u8::from(other == n))).collect();
            let [q, dq, _] = self.plant.point(&self.rig.host.row(&unit).unwrap());
            state.extend([q, dq]);
        }
        let cavity = self.plant.state();
        state.extend([cavity.q2, cavity.dq2]);
        DVector::from_fn(state.len(), |n, _| state[n] / self.scale[n % 2])
    }

    /// The same plant in another state.
    fn moved(&self, state: &DVector<f64>) -> Self {
        let value = |n: usize| state[n] * self.scale[n % 2];
        let count = state.len() - 2;
        let mut plant = self.plant.clone();
        let state = StructureState {
            displacements: (0..count).step_by(2).map(value).collect(),
            velocities: (1..count).step_by(2).map(value).collect(),
            q2: value(count),
            dq2: value(count + 1),
        };
        plant.set_coordinates(&state).unwrap();
        Self { plant, ..*self }
    }

    fn advance(&mut self, periods: usize) {
        for _ in 0..periods {
            self.plant.advance(self.drive, TAU / self.drive.omega).unwrap();
        }
    }

    /// The derivative of the state after a period.
    fn derivative(&self, step: f64) -> DMatrix<f64> {
        let here = self.state();
        let after = |column: usize, step: f64| {
            let mut state = here.clone();
            state[column] += step;
            let mut moved = self.moved(&state);
            moved.advance(1);
            moved.state()
        };
        let columns = (0..here.len()).map(|n| (after(n, step) - after(n, -step)) / (2.0 * step));
        DMatrix::from_columns(&columns.collect::<Vec<_>>())
    }
}

/// The largest distance of a stable orbit from its start after whole periods.
fn departs(rig: &Rig, orbit: &StructureOrbit) -> f64 {
    let mut motion = Motion::on(rig, orbit);
    let start = motion.state();
    motion.advance(PERIODS);
    (motion.state() - start).amax()
}

/// The eigenvector of a matrix for an eigenvalue.
fn eigenvector(matrix: &DMatrix<f64>, value: Complex<f64>) -> DVector<Complex<f64>> {
    let size = matrix.nrows();
    let shifted = matrix.map(Complex::from) - DMatrix::identity(size, size) * value;
    let svd = shifted.svd(false, true);
    svd.v_t.unwrap().row(svd.singular_values.imin()).adjoint()
}

/// Relative errors of the rate of growth: by the derivative of the plant's motion, and of a disturbed plant that leaves the orbit; `None` if the
/// disturbance grows by less than e in all periods.
fn rates(rig: &Rig, orbit: &StructureOrbit) -> Option<[f64; 2]> {
    let expected = 2.0 * orbit.stability.growth().ln();
    if expected * (PERIODS as f64) < 1.0 {
        return None;
    }
    let motion = Motion::on(rig, orbit);
    let start = motion.state();
    let small = (FAST / expected.exp()).min(1.0);
    let derivative = motion.derivative(STEP * small);
    let multipliers = derivative.complex_eigenvalues();
    let largest = multipliers
        .iter()
        .copied()
        .max_by(|one, other| one.norm().total_cmp(&other.norm()));
    let largest = largest.unwrap();
    // The left eigenvector sees the growing disturbance only.
    let left = eigenvector(&derivative.transpose(), largest);
    let along = |state: &DVector<f64>| (left.transpose() * (state - &start).map(Complex::from))[0].norm();
    let direction = eigenvector(&derivative, largest).map(|entry| entry.re);
    let mut moved = motion.moved(&(&start + &direction * (DISTURBED * small / direction.amax())));
    let first = along(&moved.state());
    let (mut periods, mut last) = (0, first);
    while periods < PERIODS {
        moved.advance(1);
        let state = moved.state();
        if periods > 0 && (&state - &start).amax() > FAR {
            break;
        }
        (periods, last) = (periods + 1, along(&state));
    }
    let rate = (last / first).ln() / periods as f64;
    Some([largest.norm().ln(), rate].map(|rate| (rate / expected - 1.0).abs()))
}

/// Some numbers, of structures of one kind.
type Found = Vec<(&'static str, f64)>;

/// Prints number, median and largest of the numbers of each kind of structure and of all of them; the largest of all.
fn summary(quantity: &str, found: &Found) -> f64 {
    let mut kinds: Vec<&str> = found.iter().map(|(kind, _)| *kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut worst = 0.0;
    for kind in kinds.into_iter().chain(["all"]) {
        let of_kind = found.iter().filter(|(other, _)| kind == "all" || kind == *other);
        let mut numbers: Vec<f64> = of_kind.map(|(_, number)| *number).collect();
        numbers.sort_by(f64::total_cmp);
        worst = *numbers.last().unwrap();
        println!(
            "{quantity},{kind},{},{:.1e},{worst:.1e}",
            numbers.len(),
            numbers[numbers.len() / 2]
        );
    }
    worst
}

#[test]
fn random_structures_stay_on_stable_orbits_and_leave_unstable_ones_at_the_rate_of_the_largest_multiplier() {
    let structures = setting("STRUCTURES", 20) as usize;
    let mut random = ChaCha8Rng::seed_from_u64(setting("SEED", 1));
    let [mut stable, mut multipliers, mut departures]: [Found; 3] = Default::default();
    let mut found = 0;
    while found < structures {
        let rig = rig(&mut random);
        let Some(range) = rig.orbits.range(rig.driven, 40) else {
            continue;
        };
        // At the ends of a branch, impacts graze.
        let branches = rig.orbits.backbone(&range);
        let inside = branches
            .iter()
            .flat_map(|branch| branch.orbits.iter().skip(1).rev().skip(1));
        let (settled, lost): (Vec<_>, Vec<_>) = inside.partition(|orbit| orbit.stability.stable);
        if settled.is_empty() && lost.is_empty() {
            continue;
        }
        found += 1;
        if !settled.is_empty() {
            let orbit = settled[pick(&mut random, settled.len())];
            stable.push((rig.kind, departs(&rig, orbit)));
        }
        if !lost.is_empty() {
            let orbit = lost[pick(&mut random, lost.len())];
            if let Some([multiplier, departure]) = rates(&rig, orbit) {
                multipliers.push((rig.kind, multiplier));
                departures.push((rig.kind, departure));
            }
        }
    }
    println!("quantity,structures,number,median,worst");
    let worst = [
        (
            "distance of a stable orbit from its start after 200 periods over its size",
            &stable,
        ),
        (
            "relative error of the rate by the largest multiplier of the plant's map",
            &multipliers,
        ),
        (
            "relative error of the rate at which the plant leaves an unstable orbit",
            &departures,
        ),
    ]
    .map(|(quantity, found)| summary(quantity, found));
    assert!(stable.len() > structures / 4 && departures.len() > structures / 4);
    assert!(worst[0] < 1e-10 && worst[1] < 0.01 && worst[2] < 0.01, "{worst:?}");
}

#[test]
fn no_symmetric_motion_that_a_plant_settles_on_is_missing_from_the_orbits_of_its_drive() {
    const SETTLE: usize = 1500;
    let rigs = setting("STRUCTURES", 20);
    let mut random = ChaCha8Rng::seed_from_u64(setting("SEED", 1));
    let (mut symmetric, mut count) = (0, 0);
    while count < rigs {
        let rig = rig(&mut random);
        let Some(range) = rig.orbits.range(rig.driven, 20) else {
            continue;
        };
        let branches = rig.orbits.backbone(&range);
        let all: Vec<&StructureOrbit> = branches.iter().flat_map(|branch| &branch.orbits).collect();
        if all.is_empty() {
            continue;
        }
        count += 1;
        // A drive beside one that holds an orbit at phase resonance.
        let orbit = all[pick(&mut random, all.len())];
        let beside = StructureOrbit {
            drive: orbit.drive * within(&mut random, [0.8, 1.3]),
            omega: orbit.omega * within(&mut random, [0.998, 1.002]),
            ..orbit.clone()
        };
        let mut motion = Motion::on(&rig, &beside);
        motion.advance(SETTLE);
        let (before, impacts) = (motion.state(), motion.plant.totals().impacts);
        let half = 0.5 * TAU / beside.omega;
        motion.plant.advance(motion.drive, half).unwrap();
        let left = (motion.state() + &before).amax();
        motion.plant.advance(motion.drive, half).unwrap();
        if left > 1e-6 || motion.plant.totals().impacts != impacts + 2 {
            continue;
        }
        symmetric += 1;
        let speed = motion.plant.state().dq2.abs();
        let found = rig.orbits.at(beside.omega, beside.drive);
        // What is left to settle is the last change over the rate of decay.
        let is_near = |orbit: &StructureOrbit| {
            (orbit.speed / speed - 1.0).abs() < 1e-9 + 10.0 * left / (1.0 - orbit.stability.growth())
        };
        let is_found = found.iter().any(|orbit| orbit.stability.stable && is_near(orbit));
        assert!(
            is_found,
            "{} at {} rad/s: {speed} m/s {left:e}, {found:?}",
            rig.kind, beside.omega
        );
    }
    println!("{symmetric} symmetric motions of {count} structures");
    assert!(symmetric > rigs / 8, "{symmetric}");
}
