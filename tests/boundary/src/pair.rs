//! Plant and controller coupled as a master couples them: the default scene, a digest of every output bit, and the lock.

use fmi2_component::Status;
use fmi2_description::{Causality, Description, FmiType};
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

/// Value references of one of the two, from its description.
#[derive(Debug)]
struct References {
    /// What it is given in every step, and what the other one is given of it.
    inputs: [u32; 2],
    sensors: [u32; 2],
    /// What is set before the start.
    start: u32,
    /// Everything that it puts out, by the type of the C interface.
    reals: Vec<u32>,
    integers: Vec<u32>,
    booleans: Vec<u32>,
}

impl References {
    fn of(fmu: &Fmu, inputs: [&str; 2], sensors: [&str; 2], start: &str) -> Self {
        let description = description(fmu);
        let one = |name: &str| reference(fmu, name);
        let all = |kinds: &[FmiType]| {
            let put_out = description
                .variables
                .iter()
                .filter(|variable| matches!(variable.causality, Causality::Output | Causality::Local));
            put_out
                .filter(|variable| variable.content().is_some_and(|(kind, _)| kinds.contains(&kind)))
                .map(|variable| variable.value_reference)
                .collect()
        };
        Self {
            inputs: inputs.map(one),
            sensors: sensors.map(one),
            start: one(start),
            reals: all(&[FmiType::Real]),
            integers: all(&[FmiType::Integer, FmiType::Enumeration]),
            booleans: all(&[FmiType::Boolean]),
        }
    }
}

fn description(fmu: &Fmu) -> Description {
    Description::parse(fmu.description).expect("the library was built from it")
}

fn reference(fmu: &Fmu, name: &str) -> u32 {
    let description = description(fmu);
    let variable = description.variable(name);
    variable
        .unwrap_or_else(|| panic!("{} has no {name}", fmu.name))
        .value_reference
}

/// The two, exchanging values at communication points. The controller's commands reach the plant one step later.
#[derive(Debug)]
pub struct Pair {
    /// The structure under test.
    pub plant: Master,
    /// The phase-locked loop.
    pub controller: Master,
    references: [References; 2],
    locked: u32,
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
        let references = [
            References::of(plant, ["omega", "E"], ["v", "base"], "der(q2)"),
            References::of(controller, ["response", "reference"], ["omega", "E"], "active"),
        ];
        let locked = reference(controller, "locked");
        let plant = Master::new(plant, Interface::CoSimulation);
        plant.well(plant.set_real(references[0].start, 0.5));
        plant.start();
        let controller = Master::new(controller, Interface::CoSimulation);
        // SAFETY: one reference, one value.
        let armed = unsafe { (controller.f.fmi2SetBoolean)(controller.c, &references[1].start, 1, &1) };
        controller.well(armed);
        controller.start();
        let digest = Sha256::new();
        Self { plant, controller, references, locked, time: 0.0, digest }
    }

    /// Hands values on, and takes a step of `step` s; answers the frequency of the drive, rad/s.
    pub fn step(&mut self, step: f64) -> f64 {
        let Self { plant, controller, references: [of_plant, of_controller], .. } = self;
        let (sensed, drive) = (
            reals(plant, &of_plant.sensors),
            reals(controller, &of_controller.sensors),
        );
        set(controller, &of_controller.inputs, &sensed);
        set(plant, &of_plant.inputs, &drive);
        plant.well(plant.step(self.time, step));
        controller.well(controller.step(self.time, step));
        self.time += step;
        drive[0]
    }

    /// Takes every output bit of both into the digest.
    pub fn digest(&mut self) {
        for (master, of) in [&self.plant, &self.controller].into_iter().zip(&self.references) {
            for value in reals(master, &of.reals) {
                self.digest.update(value.to_bits().to_le_bytes());
            }
            for value in [integers(master, &of.integers), booleans(master, &of.booleans)].concat() {
                self.digest.update(value.to_le_bytes());
            }
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
        booleans(&self.controller, &[self.locked])[0] != 0
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

fn reals(m: &Master, references: &[u32]) -> Vec<f64> {
    let mut values = vec![f64::NAN; references.len()];
    // SAFETY: arrays of the same length; so below.
    m.well(unsafe { (m.f.fmi2GetReal)(m.c, references.as_ptr(), references.len(), values.as_mut_ptr()) });
    values
}

fn integers(m: &Master, references: &[u32]) -> Vec<i32> {
    let mut values = vec![-1; references.len()];
    // SAFETY: as above.
    m.well(unsafe { (m.f.fmi2GetInteger)(m.c, references.as_ptr(), references.len(), values.as_mut_ptr()) });
    values
}

fn booleans(m: &Master, references: &[u32]) -> Vec<i32> {
    let mut values = vec![-1; references.len()];
    // SAFETY: as above.
    m.well(unsafe { (m.f.fmi2GetBoolean)(m.c, references.as_ptr(), references.len(), values.as_mut_ptr()) });
    values
}

#[track_caller]
fn set(m: &Master, references: &[u32], values: &[f64]) {
    assert_eq!(references.len(), values.len());
    // SAFETY: as above.
    let status: Status = unsafe { (m.f.fmi2SetReal)(m.c, references.as_ptr(), references.len(), values.as_ptr()) };
    m.well(status);
}
