//! The plant through its C interface, as an FMI master in C would call it: two inputs set, one step, four outputs read.

use fmi2_boundary::{Fmu, Interface, Master};

use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

/// The library of the plant's FMU, loaded once.
pub struct Shell {
    rig: Master,
    time: f64,
    state: [f64; 4],
}

/// Value references of q1, der(q1), q2 and der(q2), and of omega and E.
const STATE: [u32; 4] = [9, 10, 11, 12];
const INPUTS: [u32; 2] = [8, 7];

impl Method for Shell {
    fn start(scene: &Scene, _setting: f64) -> Result<Self, Failure> {
        use std::sync::OnceLock;
        static PLANT: OnceLock<Fmu> = OnceLock::new();
        let rig = Master::new(PLANT.get_or_init(Fmu::plant), Interface::CoSimulation);
        let p = &scene.parameters;
        let masses = [
            p.primary_mass,
            p.stiffness,
            p.damping,
            p.particle_mass,
            p.half_width,
            p.restitution,
        ];
        for (vr, value) in (0..).zip(masses).chain(STATE.into_iter().zip(scene.start)) {
            rig.well(rig.set_real(vr, value));
        }
        if let Some(first) = scene.steps.first() {
            rig.well(rig.set_reals(&INPUTS, &[first.omega, first.amplitude]));
        }
        rig.start();
        Ok(Self { rig, time: 0.0, state: scene.start })
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        self.rig
            .well(self.rig.set_reals(&INPUTS, &[step.omega, step.amplitude]));
        self.rig.well(self.rig.step(self.time, step.duration));
        self.time += step.duration;
        self.state = self.rig.reals(&STATE);
        Ok(())
    }

    fn state(&self) -> [f64; 4] {
        self.state
    }

    fn impacts(&self) -> u64 {
        u64::try_from(self.rig.impacts()).unwrap_or(0)
    }
}
