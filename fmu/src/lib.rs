//! The plant as an FMI 2.0 component: connects variables to the numbers of the plant.
//!
//! Co-simulation uses the plant in closed form, model exchange its equations.
#![forbid(unsafe_code)]

mod derivatives;
mod exchange;
mod log;
mod model_exchange;
mod outputs;
mod reach;
mod settings;
mod structure;

use crate::model_exchange::hybrid::Hybrid;
use crate::reach::lost;
use fmi2_component::{Archive, Component, Key, Log, Refusal, Resources};
use lovines::plant::Contact;
use lovines::table::Values;
use lovines::{BaseMotion, Drive, Outcome, Parameters, Plant, State, Structure};
use outputs::Outputs;
use reach::Reach;
use std::ops::Range;
use std::sync::Arc;
use structure::Adopted;
use variables::{Integer, Model, Real};

mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

fmi2_component::export!(LoViNes, model_exchange);

/// What a master has set, and the simulation made from it.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct LoViNes {
    simulation: Simulation,
    /// What moves the base; the derivatives of its signal hold for one step.
    inputs: Inputs,
    /// Whether an input was set since the last step: the inputs then determine the base, not the end of the step.
    inputs_set: bool,
    /// Progress of the simulation.
    progress: Progress,
    #[serde(skip)]
    outputs: Outputs,
    /// The mass ratio m/M.
    epsilon: f64,
    #[serde(skip)]
    reach: Reach,
    /// What was set, and the parameters of the rig: those set last that did not contradict each other.
    values: Values,
    /// Whether what was set is known not to contradict itself.
    #[serde(skip)]
    valid: bool,
    parameters: Parameters,
    start: State,
    /// What takes the oscillator's place.
    #[serde(skip)]
    adopted: Option<Arc<Adopted>>,
}

/// What a master sets of the drive. Its time derivatives are coefficients of a Taylor polynomial, as in [`Drive`].
///
/// Amplitude and frequency are not side by side, as they are in [`Drive`]: one load of both would have to wait until the stores of both have
/// reached the cache, which takes as long as a step.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
#[repr(C)]
struct Inputs {
    amplitude: f64,
    signal: f64,
    omega: f64,
    derivatives: [f64; 3],
}

impl Inputs {
    #[inline]
    fn drive(&self) -> Drive {
        let Self { amplitude, signal, omega, derivatives: [u1, u2, u3] } = *self;
        Drive { signal: [signal, u1, u2, u3], amplitude, omega }
    }
}

/// The simulation for the interface that the master has chosen.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
#[allow(clippy::large_enum_variant)] // one per instance; a pointer would cost time in every step
enum Simulation {
    Steps(Plant),
    Equations(Hybrid),
    #[serde(skip)]
    Structure(Box<Plant<Structure>>),
}

/// Evaluates an expression with the plant of co-simulation, whatever carries the cavity; `else` is for model exchange.
macro_rules! with_plant {
    ($simulation:expr, $plant:ident => $with:expr, else $hybrid:pat => $without:expr) => {
        match $simulation {
            Simulation::Steps($plant) => $with,
            Simulation::Structure($plant) => $with,
            Simulation::Equations($hybrid) => $without,
        }
    };
}
use with_plant;

/// The highest order of input derivatives that is followed.
const INPUT_ORDER: u32 = 3;

#[derive(Clone, Copy, PartialEq, PartialOrd, serde::Serialize, serde::Deserialize)]
enum Progress {
    /// Not yet made from the values set.
    None,
    /// At its start: outputs with exact start values have these values.
    Initialised,
    UnderWay,
}

impl Component for LoViNes {
    type Model = Model;

    const TAKES_EVERY_INPUT: bool = true;

    fn new() -> Self {
        // The shell overwrites all of this with the start values of the table.
        let parameters = Parameters::dimensionless(1.0, 0.0, 1.0);
        let start = State::default();
        Self {
            simulation: Simulation::Steps(Plant::new(parameters, start).expect("unit parameters make sense")),
            inputs: Inputs::default(),
            inputs_set: false,
            progress: Progress::None,
            outputs: Outputs::default(),
            epsilon: 1.0,
            reach: Reach::default(),
            parameters,
            values: Values::from(&parameters),
            valid: false,
            start,
            adopted: None,
        }
    }

    fn adopt(&mut self, guid: &str, resources: &Resources) -> Result<(), Refusal> {
        let adopted = Adopted::read(guid, resources)?;
        self.values = adopted.values;
        [self.start.q2, self.start.dq2] = adopted.particle;
        self.adopted = Some(Arc::new(adopted));
        // What cannot be started is refused at once.
        self.make_plant()
    }

    fn further(&self) -> Range<u32> {
        self.adopted.as_ref().map_or(0..0, |adopted| adopted.outputs())
    }

    fn get_further(&self, reference: u32) -> f64 {
        self.at_point(reference)
    }

    #[inline(always)]
    fn get_real(&self, variable: Real) -> f64 {
        let kept = self.outputs.get(variable);
        if kept.is_nan() { self.work_out(variable) } else { kept }
    }

    #[inline]
    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        let input = match variable {
            Real::e => &mut self.inputs.signal,
            Real::E => &mut self.inputs.amplitude,
            Real::omega => &mut self.inputs.omega,
            _ => return self.configure(variable, value),
        };
        // Masters set all inputs before every step, whether they have changed or not.
        if input.to_bits() != value.to_bits() {
            *input = value;
            self.input();
        }
        Ok(())
    }

    fn get_integer(&self, variable: Integer) -> i32 {
        let (totals, contact) = with_plant!(
            &self.simulation,
            plant => (*plant.totals(), plant.contact()),
            else hybrid => (hybrid.totals(), hybrid.contact().and_then(Contact::wall))
        );
        match variable {
            Integer::impacts => i32::try_from(totals.impacts).unwrap_or(i32::MAX),
            Integer::contact => contact.map_or(0, |wall| wall.sign() as i32),
            Integer::sticks => i32::try_from(totals.sticks).unwrap_or(i32::MAX),
            parameter => self.whole(parameter),
        }
    }

    fn set_integer(&mut self, variable: Integer, value: i32) -> Result<(), Refusal> {
        self.set_parameter(variable, value.into())
    }

    fn initialise(&mut self, start_time: f64, _log: &Log) -> Result<(), Refusal> {
        self.make_plant()?;
        self.fit_limits();
        with_plant!(
            &mut self.simulation,
            plant => {
                self.reach.check(&self.start)?;
                plant.set_time(start_time);
                plant.begin(self.inputs.drive())?;
            },
            else hybrid => hybrid.time = start_time
        );
        self.epsilon = self.parameters.mass_ratio();
        self.progress = Progress::Initialised;
        self.inputs_set = false;
        self.outputs = Outputs::default();
        Ok(())
    }

    fn leave_initialization(&mut self) {
        // From now on the states of the integrator count, not the values that were set.
        if matches!(self.simulation, Simulation::Equations(_)) {
            self.progress = Progress::UnderWay;
        }
    }

    #[inline]
    fn accept_step(&self, step: f64) -> Result<(), Refusal> {
        if self.accepts(step) { Ok(()) } else { self.judge(step) }
    }

    #[inline]
    fn step(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal> {
        let outcome = match &mut self.simulation {
            Simulation::Steps(plant) => {
                plant.set_time(time);
                // Lines that are not wanted are not written: one copy of the plant's code for both cases.
                plant.advance_with(self.inputs.drive(), step, |event| log::tell(log, time, event))?
            }
            Simulation::Structure(_) => return self.step_of_structure(time, step, log),
            Simulation::Equations(_) => return Err(Refusal::error("steps exist in co-simulation only")),
        };
        self.finish(time, step, &outcome)
    }

    fn set_real_input_derivative(&mut self, variable: Real, order: u32, value: f64, log: &Log) -> Result<(), Refusal> {
        let name = variable.variable().name;
        if order > INPUT_ORDER {
            return Err(Refusal::error(format!(
                "derivative {order} of {name} is refused; allowed are orders 1 to {INPUT_ORDER}"
            )));
        }
        if !matches!(variable, Real::e) {
            if value != 0.0 {
                log.warn_once(
                    name,
                    format_args!(
                        "derivatives of {name} have no effect: E and omega are held during a step; those of e are followed"
                    ),
                );
            }
            return Ok(());
        }
        // The coefficients of a Taylor polynomial.
        let derivatives = &mut self.inputs.derivatives;
        match order {
            1 => derivatives[0] = value,
            2 => derivatives[1] = value / 2.0,
            _ => derivatives[2] = value / 6.0,
        }
        Ok(())
    }

    fn get_real_output_derivative(&self, variable: Real, order: u32) -> Result<f64, Refusal> {
        self.time_derivative(variable, order)
    }

    fn partial_derivative(&self, unknown: Real, known: Real) -> Result<f64, Refusal> {
        self.slope(unknown, known)
    }

    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        let Some(adopted) = self.adopted.take() else {
            return self.archive_oscillator(archive);
        };
        // The structure itself is in the resources.
        let mut saved = match &self.simulation {
            Simulation::Structure(plant) => plant.save(),
            _ => adopted.plant(self.parameters, self.start)?.save(),
        };
        self.simulation = Self::new().simulation;
        self.archive_oscillator(archive)?;
        archive.whole(&mut saved)?;
        let mut plant = adopted.plant(self.parameters, self.start)?;
        plant.restore(&saved);
        self.simulation = Simulation::Structure(Box::new(plant));
        self.adopted = Some(adopted);
        self.fit_limits();
        Ok(())
    }
}

impl LoViNes {
    /// Makes the plant from what was set.
    fn make_plant(&mut self) -> Result<(), Refusal> {
        self.parameters = self.values.parameters();
        if let Some(adopted) = &self.adopted {
            let plant = adopted.plant(self.parameters, self.start)?;
            self.simulation = Simulation::Structure(Box::new(plant));
        }
        match &mut self.simulation {
            Simulation::Steps(plant) => *plant = Plant::new(self.parameters, self.start)?,
            Simulation::Equations(hybrid) => *hybrid = Hybrid::new(self.parameters, self.start, self.inputs.drive())?,
            Simulation::Structure(_) => {}
        }
        Ok(())
    }

    /// What follows the motion of every step.
    #[inline(always)]
    fn finish(&mut self, time: f64, step: f64, outcome: &Outcome) -> Result<(), Refusal> {
        if !self.inputs.drive().is_held() {
            self.hold_signal(step);
        }
        self.progress = Progress::UnderWay;
        self.inputs_set = false;
        let resolved = self.keep_outputs();
        if outcome.cut_short || !resolved {
            self.outputs = Outputs::default();
            return Err(lost(resolved, time, step, outcome));
        }
        Ok(())
    }

    /// The signal stays where its polynomial has led in a step.
    #[inline(never)]
    fn hold_signal(&mut self, step: f64) {
        let led = match &self.simulation {
            Simulation::Steps(plant) => plant.base(),
            // Whether it was clipped or not.
            _ => BaseMotion { drive: self.inputs.drive(), ..BaseMotion::default() }.after(step),
        };
        (self.inputs.signal, self.inputs.derivatives) = (led.drive.signal[0], [0.0; 3]);
    }

    fn archive_oscillator(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        archive.whole(self)?;
        self.valid = self.values.parameters().validate().is_ok();
        self.fit_limits();
        Ok(())
    }
}
