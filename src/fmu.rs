//! The plant as an FMI 2.0 component: which variable is which number of the physics.

use crate::{Drive, Event, Parameters, Plant, State, Wall};
use fmi2_component::{Archive, Component, Log, Refusal};
use variables::{Integer, Model, Real, category};

mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

fmi2_component::export!(LoViNes);

/// Radians of the fastest motion in one step: 16 million periods, some seconds of work.
const MOST_RADIANS: f64 = 1e8;

/// What a master has set, and the plant that came of it.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct LoViNes {
    parameters: Parameters,
    start: State,
    /// Base displacement and its first three derivatives; the derivatives hold for one step.
    e: [f64; 4],
    amplitude: f64,
    omega: f64,
    plant: Plant,
    /// Whether the plant has left its start: until then the outputs with exact start values are just those.
    stepped: bool,
    /// Whether an input was set since the last step: the base is where they say, not where the step ended.
    inputs_set: bool,
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

    /// Numbers that are finite each by itself can still be beyond what double precision can put together.
    fn check_state(&self) -> Result<(), Refusal> {
        let State { q1, dq1, q2, dq2 } = self.plant.state();
        let w = self.plant.relative_displacement();
        let finite = [q1, dq1, q2, dq2].iter().all(|x| x.is_finite());
        if finite && w.abs() <= self.parameters.half_width {
            return Ok(());
        }
        Err(Refusal::error(format!(
            "the state is beyond double precision: q1 = {q1} m, q2 = {q2} m, w = {w} m; \
             allowed are inputs and start values of a size that leaves w from -b to b = {} m some digits",
            self.parameters.half_width
        )))
    }

    /// A step takes time in proportion to the radians of the fastest motion in it.
    fn check_step(&self, drive: &Drive, step: f64) -> Result<(), Refusal> {
        let rate = self.parameters.fastest_rate().max(drive.omega.abs());
        if rate * step <= MOST_RADIANS {
            return Ok(());
        }
        Err(Refusal::error(format!(
            "a step of {step} s is refused; allowed is at most {} s while the fastest rate of the motion is {rate} rad/s \
             ({MOST_RADIANS} rad in one step)",
            MOST_RADIANS / rate
        )))
    }

    fn state(&self) -> State {
        if self.stepped {
            self.plant.state()
        } else {
            self.start
        }
    }

    fn base(&self) -> f64 {
        if self.inputs_set {
            self.plant.base().with(self.drive()).displacement()
        } else {
            self.plant.base().displacement()
        }
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
            plant: Plant::new(parameters, start).expect("unit parameters make sense"),
            stepped: false,
            inputs_set: false,
        }
    }

    fn get_real(&self, variable: Real) -> f64 {
        let Self {
            parameters, plant, ..
        } = self;
        match variable {
            Real::M => parameters.primary_mass,
            Real::k => parameters.stiffness,
            Real::c => parameters.damping,
            Real::m => parameters.particle_mass,
            Real::b => parameters.half_width,
            Real::r => parameters.restitution,
            Real::e => self.e[0],
            Real::E => self.amplitude,
            Real::omega => self.omega,
            Real::q1 => self.state().q1,
            Real::der_q1 => self.state().dq1,
            Real::q2 => self.state().q2,
            Real::der_q2 => self.state().dq2,
            Real::v => plant.centre(),
            Real::w => plant.relative_displacement(),
            Real::der_w => plant.relative_velocity(),
            Real::base => self.base(),
            Real::phase => plant.base().phase.radians(),
            Real::impact_time => plant.tally().impact_time,
            Real::impact_velocity => plant.tally().impact_velocity,
            Real::energy => plant.energy(self.base()),
            Real::dissipated => plant.tally().dissipated,
        }
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        let slot = match variable {
            Real::M => &mut self.parameters.primary_mass,
            Real::k => &mut self.parameters.stiffness,
            Real::c => &mut self.parameters.damping,
            Real::m => &mut self.parameters.particle_mass,
            Real::b => &mut self.parameters.half_width,
            Real::r => &mut self.parameters.restitution,
            Real::q1 => &mut self.start.q1,
            Real::der_q1 => &mut self.start.dq1,
            Real::q2 => &mut self.start.q2,
            Real::der_q2 => &mut self.start.dq2,
            Real::e | Real::E | Real::omega => {
                self.inputs_set = true;
                match variable {
                    Real::e => &mut self.e[0],
                    Real::E => &mut self.amplitude,
                    _ => &mut self.omega,
                }
            }
            _ => return Err(Refusal::error("this variable is computed, not set")),
        };
        *slot = value;
        Ok(())
    }

    fn get_integer(&self, variable: Integer) -> i32 {
        match variable {
            Integer::impacts => i32::try_from(self.plant.tally().impacts).unwrap_or(i32::MAX),
            Integer::contact => self.plant.contact().map_or(0, |wall| wall.sign() as i32),
        }
    }

    fn initialise(&mut self, start_time: f64, _log: &Log) -> Result<(), Refusal> {
        self.plant = Plant::new(self.parameters, self.start)?;
        self.plant.set_time(start_time);
        self.plant.begin(self.drive());
        self.stepped = false;
        self.inputs_set = false;
        Ok(())
    }

    fn step(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal> {
        self.plant.set_time(time);
        let drive = self.drive();
        self.check_step(&drive, step)?;
        if log.wants(category::logEvents) || log.wants(category::logImpacts) {
            self.plant
                .advance_with(drive, step, |event| tell(log, time, event));
        } else {
            self.plant.advance(drive, step);
        }
        // The signal stays where its polynomial has led.
        self.e = [self.plant.base().drive.signal[0], 0.0, 0.0, 0.0];
        self.stepped = true;
        self.inputs_set = false;
        self.check_state()
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

    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        archive.whole(self)
    }
}

/// One line for the master's log.
fn tell(log: &Log, time: f64, event: Event) {
    let side = |wall: Wall| {
        if wall == Wall::Plus {
            "w = b"
        } else {
            "w = -b"
        }
    };
    match event {
        Event::Impact { t, wall, velocity } => log.tell(
            category::logImpacts,
            format_args!(
                "impact on the wall {} at t = {} s, der(w) = {velocity} m/s",
                side(wall),
                time + t
            ),
        ),
        Event::Stuck { t, wall } => log.tell(
            category::logEvents,
            format_args!(
                "the particle came to rest on the wall {} at t = {} s",
                side(wall),
                time + t
            ),
        ),
        Event::Released { t, wall } => log.tell(
            category::logEvents,
            format_args!(
                "the wall {} let the particle go at t = {} s",
                side(wall),
                time + t
            ),
        ),
    }
}
