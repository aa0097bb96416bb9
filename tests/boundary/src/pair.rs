//! Plant and controller coupled as a master couples them: the default scene, a digest of every output bit, and the lock.

use fmi2_description::{Causality, FmiType};
use sha2::{Digest, Sha256};

use crate::{Fmu, Interface, Master, call};

/// The controller's sample time, s: a hundredth of the natural period.
pub const SAMPLE_TIME: f64 = 0.001_134_357_339_553_793_8;
/// The frequency of the undamped primary mass, rad/s.
const OMEGA0: f64 = 55.389_823_718_609_82;
/// The mass ratio m/M.
const EPSILON: f64 = 0.032 / 3.807;

/// One of the two: its inputs, what it gives to the other one, and all real variables that it puts out.
#[derive(Debug)]
struct Side {
    master: Master,
    inputs: [u32; 2],
    given: [u32; 2],
    outputs: Vec<u32>,
}

impl Side {
    fn new(fmu: &Fmu, inputs: [&str; 2], given: [&str; 2]) -> Self {
        let variables = fmu.parsed().variables;
        let outputs = variables.iter().filter(|variable| {
            let real = variable.content().is_some_and(|(kind, _)| kind == FmiType::Real);
            real && matches!(variable.causality, Causality::Output | Causality::Local)
        });
        Self {
            master: Master::new(fmu, Interface::CoSimulation),
            inputs: inputs.map(|name| fmu.reference(name)),
            given: given.map(|name| fmu.reference(name)),
            outputs: outputs.map(|variable| variable.value_reference).collect(),
        }
    }
}

/// The two, exchanging values at communication points. The controller's commands reach the plant one step later.
#[derive(Debug)]
pub struct Pair {
    plant: Side,
    controller: Side,
    locked: u32,
    time: f64,
    digest: Sha256,
}

impl Pair {
    /// The default scene: the particle at 0.5 m/s, the controller active.
    pub fn new([plant, controller]: &[Fmu; 2]) -> Self {
        let [locked, active] = ["locked", "active"].map(|name| controller.reference(name));
        let start = plant.reference("der(q2)");
        let plant = Side::new(plant, ["omega", "E"], ["v", "base"]);
        let controller = Side::new(controller, ["response", "reference"], ["omega", "E"]);
        plant.master.well(plant.master.set_real(start, 0.5));
        let m = &controller.master;
        m.well(call!(m.fmi2SetBoolean(&active, 1, &1)));
        plant.master.start();
        controller.master.start();
        Self { plant, controller, locked, time: 0.0, digest: Sha256::new() }
    }

    /// Hands values on, and takes a step of `step` s; returns the frequency of the drive, rad/s.
    pub fn step(&mut self, step: f64) -> f64 {
        let given = [&self.plant, &self.controller].map(|side| side.master.reals(&side.given));
        for (side, values) in [(&self.controller, given[0]), (&self.plant, given[1])] {
            side.master.well(side.master.set_reals(&side.inputs, &values));
        }
        for side in [&self.plant, &self.controller] {
            side.master.well(side.master.step(self.time, step));
        }
        self.time += step;
        given[1][0]
    }

    /// Takes over the states of another pair, as bytes.
    pub fn take_over(&mut self, other: &Self) {
        for (side, of) in [(&self.plant, &other.plant), (&self.controller, &other.controller)] {
            side.master.well(side.master.restore(&of.master.bytes()));
        }
        self.time = other.time;
    }

    /// Takes the state of both, and every real output, into the digest.
    pub fn digest(&mut self) {
        for side in [&self.plant, &self.controller] {
            self.digest.update(side.master.bytes());
            for vr in &side.outputs {
                self.digest.update(side.master.real(*vr).to_bits().to_le_bytes());
            }
        }
    }

    /// SHA-256 of all outputs digested, in hexadecimal.
    pub fn hash(&self) -> String {
        let bytes = self.digest.clone().finalize();
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Impacts so far.
    pub fn impacts(&self) -> i32 {
        self.plant.master.impacts()
    }

    /// Whether the controller reports a lock.
    pub fn is_locked(&self) -> bool {
        self.controller.master.boolean(self.locked)
    }

    /// Runs for some natural periods, in steps that `next` chooses, s. Returns the detuning, as the mean over the last 20 periods.
    pub fn run(&mut self, periods: f64, mut next: impl FnMut() -> f64) -> f64 {
        let end = periods * 100.0 * SAMPLE_TIME;
        let hold = end - 20.0 * 100.0 * SAMPLE_TIME;
        let (mut sum, mut held) = (0.0, 0.0);
        while self.time < end {
            let (before, step) = (self.time, next());
            let omega = self.step(step);
            if before >= hold {
                sum += omega * step;
                held += step;
            }
        }
        (sum / held / OMEGA0 - 1.0) / EPSILON
    }
}
