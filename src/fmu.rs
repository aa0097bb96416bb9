//! The plant as an FMI 2.0 component: which variable is which number of the physics.
//!
//! For co-simulation that is the plant in closed form, for model exchange its equations.

mod derivatives;
mod exchange;
mod log;

use crate::hybrid::Hybrid;
use crate::plant::MOST_IMPACTS;
use crate::{Drive, InvalidValue, Parameters, Plant, State};
use fmi2_component::{Archive, Component, Log, Refusal};
use variables::{Integer, Model, Real, category};

mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

fmi2_component::export!(LoViNes, model_exchange);

/// What a master has set, and the rig that came of it.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct LoViNes {
    parameters: Parameters,
    start: State,
    /// Base displacement and its first three derivatives; the derivatives hold for one step.
    e: [f64; 4],
    amplitude: f64,
    omega: f64,
    rig: Rig,
    /// How far the rig has come.
    progress: Progress,
    /// The fastest rate of the motion but for that of the drive, rad/s.
    fastest: f64,
    /// Whether an input was set since the last step: the base is where they say, not where the step ended.
    inputs_set: bool,
}

/// The rig as the master's choice of interface wants it.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
#[allow(clippy::large_enum_variant)] // one of them in an instance, and no way round by a pointer in every step
enum Rig {
    Steps(Plant),
    Equations(Hybrid),
}

/// The longest step that is taken, in radians of the fastest rate: more than ten thousand periods.
const LONGEST_STEP: f64 = 1e5;

/// Why a step could not be finished.
#[cold]
fn lost(finite: bool, time: f64, step: f64) -> Refusal {
    Refusal::error(if finite {
        format!(
            "there are more than {MOST_IMPACTS} impacts within the step of {step} s at t = {time} s; expected are \
             velocities and a half-width of the cavity that make sense together, or a shorter step"
        )
    } else {
        format!(
            "displacements and velocities have left the range of numbers in the step at t = {time} s; expected are \
             start values and inputs of a sensible size"
        )
    })
}

/// The rate that bounds what a second of simulation costs.
fn fastest(p: &Parameters) -> f64 {
    (p.natural_frequency()).max(p.damping / p.primary_mass)
}

#[derive(Clone, Copy, PartialEq, PartialOrd, serde::Serialize, serde::Deserialize)]
enum Progress {
    /// It is not yet made of the values set.
    None,
    /// It stands at its start: the outputs with exact start values are just those.
    Initialised,
    UnderWay,
}

impl LoViNes {
    fn drive(&self) -> Drive {
        let [e, d1, d2, d3] = self.e;
        Drive {
            signal: [e, d1, d2 / 2.0, d3 / 6.0],
            amplitude: self.amplitude,
            omega: self.omega,
        }
    }

    /// A value that follows from the plant's state.
    fn of_plant(&self, plant: &Plant, variable: Real) -> f64 {
        let state = || match self.progress {
            Progress::UnderWay => plant.state(),
            _ => self.start,
        };
        match variable {
            Real::q1 => state().q1,
            Real::der_q1 => state().dq1,
            Real::q2 => state().q2,
            Real::der_q2 => state().dq2,
            Real::v => plant.centre(),
            Real::w => plant.relative_displacement(),
            Real::der_w => plant.relative_velocity(),
            Real::base => self.base(plant),
            Real::phase => plant.base().phase.radians(),
            Real::impact_time => plant.tally().impact_time,
            Real::impact_velocity => plant.tally().impact_velocity,
            Real::energy => plant.energy(self.base(plant)),
            Real::dissipated => plant.tally().dissipated,
            _ => derivatives::of_instant(&self.instant(plant), variable),
        }
    }

    fn base(&self, plant: &Plant) -> f64 {
        if self.inputs_set {
            plant.base().with(self.drive()).displacement()
        } else {
            plant.base().displacement()
        }
    }

    /// Tells the rig of changed inputs.
    fn input(&mut self) {
        self.inputs_set = true;
        let drive = self.drive();
        if let Rig::Equations(hybrid) = &mut self.rig {
            hybrid.drive = drive;
        }
    }

    /// Tells the rig of changed parameters.
    fn retune(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        if self.progress != Progress::None {
            match &mut self.rig {
                Rig::Steps(plant) => plant.retune(parameters)?,
                Rig::Equations(hybrid) => hybrid.retune(parameters)?,
            }
        }
        self.parameters = parameters;
        self.fastest = fastest(&parameters);
        Ok(())
    }
}

impl Component for LoViNes {
    type Model = Model;

    fn new() -> Self {
        // The shell overwrites all of this with the start values of the table.
        let parameters = Parameters::dimensionless(1.0, 0.0, 1.0);
        let start = State::default();
        Self {
            parameters,
            start,
            e: [0.0; 4],
            amplitude: 0.0,
            omega: 0.0,
            rig: Rig::Steps(Plant::new(parameters, start).expect("unit parameters make sense")),
            progress: Progress::None,
            fastest: 0.0,
            inputs_set: false,
        }
    }

    fn get_real(&self, variable: Real) -> f64 {
        let Self { parameters: p, .. } = self;
        match variable {
            Real::M => p.primary_mass,
            Real::k => p.stiffness,
            Real::c => p.damping,
            Real::m => p.particle_mass,
            Real::b => p.half_width,
            Real::r => p.restitution,
            Real::e => self.e[0],
            Real::E => self.amplitude,
            Real::omega => self.omega,
            _ => match &self.rig {
                Rig::Steps(plant) => self.of_plant(plant, variable),
                Rig::Equations(hybrid) => exchange::of_hybrid(hybrid, variable),
            },
        }
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        let mut parameters = self.parameters;
        let slot = match variable {
            Real::e | Real::E | Real::omega => {
                match variable {
                    Real::e => self.e[0] = value,
                    Real::E => self.amplitude = value,
                    _ => self.omega = value,
                }
                self.input();
                return Ok(());
            }
            Real::q1 => &mut self.start.q1,
            Real::der_q1 => &mut self.start.dq1,
            Real::q2 => &mut self.start.q2,
            Real::der_q2 => &mut self.start.dq2,
            Real::M => &mut self.parameters.primary_mass,
            Real::m => &mut self.parameters.particle_mass,
            Real::b => &mut self.parameters.half_width,
            Real::k => &mut parameters.stiffness,
            Real::c => &mut parameters.damping,
            Real::r => &mut parameters.restitution,
            _ => return Err(Refusal::error("this variable is computed, not set")),
        };
        *slot = value;
        if matches!(variable, Real::k | Real::c | Real::r) {
            self.retune(parameters)?;
        }
        Ok(())
    }

    fn get_integer(&self, variable: Integer) -> i32 {
        let (tally, contact) = match &self.rig {
            Rig::Steps(plant) => (plant.tally(), plant.contact()),
            Rig::Equations(hybrid) => (hybrid.tally(), hybrid.contact()),
        };
        match variable {
            Integer::impacts => i32::try_from(tally.impacts).unwrap_or(i32::MAX),
            Integer::contact => contact.map_or(0, |wall| wall.sign() as i32),
        }
    }

    fn initialise(&mut self, start_time: f64, _log: &Log) -> Result<(), Refusal> {
        let drive = self.drive();
        match &mut self.rig {
            Rig::Steps(plant) => {
                *plant = Plant::new(self.parameters, self.start)?;
                plant.set_time(start_time);
                plant.begin(drive);
            }
            Rig::Equations(hybrid) => *hybrid = Hybrid::new(self.parameters, self.start, drive)?,
        }
        self.fastest = fastest(&self.parameters);
        self.progress = Progress::Initialised;
        self.inputs_set = false;
        Ok(())
    }

    fn accept_step(&self, step: f64) -> Result<(), Refusal> {
        let rate = self.fastest.max(self.omega.abs());
        if step * rate <= LONGEST_STEP {
            return Ok(());
        }
        let longest = LONGEST_STEP / rate;
        Err(Refusal::error(format!(
            "communicationStepSize = {step} s is refused; allowed are at most {longest} s, which is {LONGEST_STEP} rad \
             of the fastest rate"
        )))
    }

    fn step(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal> {
        let drive = self.drive();
        let Rig::Steps(plant) = &mut self.rig else {
            return Err(Refusal::error("a step is of co-simulation"));
        };
        plant.set_time(time);
        let outcome = if log.wants(category::logEvents) || log.wants(category::logImpacts) {
            plant.advance_with(drive, step, |event| log::tell(log, time, event))
        } else {
            plant.advance(drive, step)
        };
        // The signal stays where its polynomial has led.
        self.e = [plant.base().drive.signal[0], 0.0, 0.0, 0.0];
        self.progress = Progress::UnderWay;
        self.inputs_set = false;
        let state = plant.state();
        let finite = (state.q1 + state.dq1 + state.dq2).is_finite()
            && plant.relative_displacement().abs() <= self.parameters.half_width;
        if outcome.cut_short || !finite {
            return Err(lost(finite, time, step));
        }
        Ok(())
    }

    fn set_real_input_derivative(
        &mut self,
        variable: Real,
        order: u32,
        value: f64,
    ) -> Result<(), Refusal> {
        match (variable, order) {
            (Real::e, 1..=3) => {
                self.e[order as usize] = value;
                Ok(())
            }
            (Real::e, _) => Err(Refusal::error(format!(
                "derivative {order} of e is refused; allowed are orders 1 to 3"
            ))),
            _ => Err(Refusal::error(
                "input derivatives are refused but for e; E and omega are held between samples",
            )),
        }
    }

    fn get_real_output_derivative(&self, variable: Real, order: u32) -> Result<f64, Refusal> {
        self.time_derivative(variable, order)
    }

    fn partial_derivative(&self, unknown: Real, known: Real) -> Result<f64, Refusal> {
        self.slope(unknown, known)
    }

    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        archive.whole(self)
    }
}
