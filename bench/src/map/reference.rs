//! The rig of the map, and its default lock: what every cell's cost is told in.

use std::f64::consts::TAU;
use std::time::Instant;

use lovines::{Drive, Outcome, Parameters, Plant, State};

/// The default scene (scenes/paper.toml), SI units.
pub const RIG: Parameters = Parameters {
    primary_mass: 3.807,
    stiffness: 11.68e3,
    damping: 2.53,
    particle_mass: 0.032,
    half_width: 0.01,
    restitution: 0.65,
    cavity: lovines::Cavity::IDEAL,
};
/// Its start: velocity of the particle, m/s.
const START: f64 = 0.5;
/// Detuning and base amplitude where its loop locks.
const LOCK: (f64, f64) = (-1.1394, 1.1);
/// Periods that pass before anything is looked at.
const SETTLING: u32 = 400;

/// The drive at a detuning and a base amplitude.
///
/// # Errors
/// A detuning whose frequency is not positive.
pub fn drive(sigma: f64, g: f64) -> anyhow::Result<Drive> {
    let epsilon = RIG.mass_ratio();
    let ratio = 1.0 + epsilon * sigma;
    if ratio > 0.0 && ratio.is_finite() && g.is_finite() {
        let omega = RIG.natural_frequency() * ratio;
        Ok(Drive::harmonic(g * RIG.half_width * epsilon, omega))
    } else {
        Err(anyhow::anyhow!(
            "sigma = {sigma}, G = {g} (dimensionless): a frequency of {ratio} omega0; allowed are finite values with a frequency above 0"
        ))
    }
}

/// The plant after so many periods from the start of the default scene, the last of which end at phase 0.
///
/// # Errors
/// A value that the plant does not accept.
pub fn settle(drive: Drive) -> anyhow::Result<Plant> {
    let start = State { dq2: START, ..State::default() };
    let mut plant = Plant::new(RIG, start)?;
    plant.begin(drive)?;
    more(&mut plant, drive, SETTLING)?;
    Ok(plant)
}

/// So many more periods in one step; answers the events.
///
/// # Errors
/// A drive that the plant does not accept.
pub fn more(plant: &mut Plant, drive: Drive, periods: u32) -> anyhow::Result<Outcome> {
    let duration = f64::from(periods) * TAU / drive.omega;
    Ok(plant.advance(drive, duration)?)
}

/// Evaluations of the motion in a step.
pub fn evaluations(outcome: &Outcome) -> Option<u64> {
    Some(outcome.evaluations)
}

/// Wall time of so many periods in one step with the state read at the end, ns, and what the step met.
///
/// # Errors
/// A drive that the plant does not accept.
pub fn timed(settled: &Plant, drive: Drive, periods: u32) -> anyhow::Result<(f64, Outcome)> {
    let mut plant = *settled;
    let duration = f64::from(periods) * TAU / drive.omega;
    let began = Instant::now();
    let outcome = plant.advance(std::hint::black_box(drive), duration);
    std::hint::black_box(plant.state());
    let ns = began.elapsed().as_nanos() as f64;
    Ok((ns, outcome?))
}

/// The default lock, settled.
pub struct Lock {
    plant: Plant,
    drive: Drive,
}

impl Lock {
    /// # Errors
    /// None, as long as the default scene is valid.
    pub fn settle() -> anyhow::Result<Self> {
        let drive = drive(LOCK.0, LOCK.1)?;
        let plant = settle(drive)?;
        Ok(Self { plant, drive })
    }

    /// Cost of an impact, ns.
    ///
    /// # Errors
    /// None, as long as the default scene is valid.
    pub fn run(&self, periods: u32) -> anyhow::Result<f64> {
        let (ns, outcome) = timed(&self.plant, self.drive, periods)?;
        Ok(ns / outcome.impacts as f64)
    }
}
