//! Plant and controller coupled as a master couples them: the default scene, a digest of every output bit, and the lock.

use fmi2_component::Status;
use sha2::{Digest, Sha256};

use crate::fuzz::RandomSource;
use crate::library::Fmu;
use crate::master::{Interface, Master};

/// The controller's sample time, s: a hundredth of the natural period.
pub const SAMPLE_TIME: f64 = 0.001_134_357_339_553_793_8;
/// The frequency of the undamped primary mass, rad/s.
const OMEGA0: f64 = 55.389_823_718_609_82;
/// The mass ratio m/M.
const EPSILON: f64 = 0.032 / 3.807;

/// Value references of the plant.
mod plant {
    pub const INPUTS: [u32; 2] = [8, 7];
    pub const SENSORS: [u32; 2] = [13, 16];
    pub const START_VELOCITY: u32 = 12;
    pub const REALS: [u32; 18] = [9, 10, 11, 12, 13, 14, 15, 16, 17, 19, 20, 22, 23, 24, 25, 26, 27, 28];
    pub const INTEGERS: [u32; 2] = [18, 21];
}

/// Value references of the controller.
mod controller {
    pub const INPUTS: [u32; 2] = [33, 34];
    pub const ACTIVE: u32 = 35;
    /// `omega` and `E`.
    pub const DRIVE: [u32; 2] = [36, 37];
    pub const REALS: [u32; 9] = [36, 37, 38, 39, 40, 41, 42, 43, 44];
    pub const BOOLEANS: [u32; 2] = [45, 46];
    pub const INTEGERS: [u32; 2] = [47, 48];
}

/// The two, exchanging values at communication points. The controller's commands reach the plant one step later.
#[derive(Debug)]
pub struct Pair {
    /// The structure under test.
    pub plant: Master,
    /// The phase-locked loop.
    pub controller: Master,
    time: f64,
    digest: Sha256,
}

impl Pair {
    /// The default scene: the particle at 0.5 m/s, the controller active.
    ///
    /// # Panics
    /// If a call is refused; so below.
    #[must_use]
    pub fn new(plant: &Fmu, controller: &Fmu) -> Self {
        let plant = Master::new(plant, Interface::CoSimulation);
        plant.well(plant.set_real(plant::START_VELOCITY, 0.5));
        plant.start();
        let controller = Master::new(controller, Interface::CoSimulation);
        // SAFETY: one reference, one value.
        let armed = unsafe { (controller.f.fmi2SetBoolean)(controller.c, &controller::ACTIVE, 1, &1) };
        controller.well(armed);
        controller.start();
        Self { plant, controller, time: 0.0, digest: Sha256::new() }
    }

    /// Hands values on, and takes a step of `step` s; answers the frequency of the drive, rad/s.
    pub fn step(&mut self, step: f64) -> f64 {
        let Self { plant, controller, .. } = self;
        let (sensed, drive) = (reals(plant, plant::SENSORS), reals(controller, controller::DRIVE));
        set(controller, controller::INPUTS, sensed);
        set(plant, plant::INPUTS, drive);
        plant.well(plant.step(self.time, step));
        controller.well(controller.step(self.time, step));
        self.time += step;
        drive[0]
    }

    /// Takes every output bit of both into the digest.
    pub fn digest(&mut self) {
        let Self { plant, controller, digest, .. } = self;
        for value in reals(plant, plant::REALS) {
            digest.update(value.to_bits().to_le_bytes());
        }
        for value in reals(controller, controller::REALS) {
            digest.update(value.to_bits().to_le_bytes());
        }
        for value in [
            integers(plant, plant::INTEGERS),
            integers(controller, controller::INTEGERS),
            booleans(controller, controller::BOOLEANS),
        ]
        .as_flattened()
        {
            digest.update(value.to_le_bytes());
        }
    }

    /// The digest of all outputs taken so far, in hexadecimal digits.
    #[must_use]
    pub fn hash(&self) -> String {
        let bytes = self.digest.clone().finalize();
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Whether the controller says that it is locked.
    #[must_use]
    pub fn is_locked(&self) -> bool {
        booleans(&self.controller, controller::BOOLEANS)[0] != 0
    }
}

/// Where a pair has locked.
#[derive(Clone, Copy, Debug)]
pub struct Lock {
    /// The frequency as sigma = (omega/omega0 - 1)/epsilon, mean over the last 20 periods.
    pub sigma: f64,
    /// Whether the controller calls it a lock.
    pub locked: bool,
}

/// Runs the default scene for so many natural periods, in steps that `next` chooses, s.
pub fn lock(pair: &mut Pair, periods: f64, mut next: impl FnMut() -> f64) -> Lock {
    let end = periods * 100.0 * SAMPLE_TIME;
    let hold = end - 20.0 * 100.0 * SAMPLE_TIME;
    let (mut sum, mut held) = (0.0, 0.0);
    while pair.time < end {
        let (before, step) = (pair.time, next());
        let omega = pair.step(step);
        if before >= hold {
            sum += omega * step;
            held += step;
        }
    }
    Lock {
        sigma: (sum / held / OMEGA0 - 1.0) / EPSILON,
        locked: pair.is_locked(),
    }
}

/// Steps between two multiples of the sample time, at random.
pub fn irregular(from: f64, to: f64, seed: u64) -> impl FnMut() -> f64 {
    let mut random = RandomSource::new(seed);
    move || random.between(from, to) * SAMPLE_TIME
}

fn reals<const N: usize>(m: &Master, references: [u32; N]) -> [f64; N] {
    let mut values = [f64::NAN; N];
    // SAFETY: arrays of the same length; so below.
    m.well(unsafe { (m.f.fmi2GetReal)(m.c, references.as_ptr(), N, values.as_mut_ptr()) });
    values
}

fn integers<const N: usize>(m: &Master, references: [u32; N]) -> [i32; N] {
    let mut values = [-1; N];
    // SAFETY: as above.
    m.well(unsafe { (m.f.fmi2GetInteger)(m.c, references.as_ptr(), N, values.as_mut_ptr()) });
    values
}

fn booleans<const N: usize>(m: &Master, references: [u32; N]) -> [i32; N] {
    let mut values = [-1; N];
    // SAFETY: as above.
    m.well(unsafe { (m.f.fmi2GetBoolean)(m.c, references.as_ptr(), N, values.as_mut_ptr()) });
    values
}

#[track_caller]
fn set<const N: usize>(m: &Master, references: [u32; N], values: [f64; N]) {
    // SAFETY: as above.
    let status: Status = unsafe { (m.f.fmi2SetReal)(m.c, references.as_ptr(), N, values.as_ptr()) };
    m.well(status);
}
