//! A water tank as an FMI 2.0 component.
#![forbid(unsafe_code)]

/// What `modelDescription.xml` says.
pub mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

use fmi2_component::{Archive, Component, Key, Log, Refusal};
use variables::{Boolean, Integer, Model, Real, String, category};

/// A tank with a vertical wall; what comes in above its rim is lost.
#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Tank {
    area: f64,
    height: f64,
    inflow: f64,
    initial_level: f64,
    valve: bool,
    label: std::string::String,
    level: f64,
    overflows: i32,
}

impl Tank {
    fn rate(&self) -> f64 {
        if self.valve { self.inflow / self.area } else { 0.0 }
    }
}

impl Component for Tank {
    type Model = Model;

    fn new() -> Self {
        Self::default()
    }

    fn get_real(&self, variable: Real) -> f64 {
        match variable {
            Real::area => self.area,
            Real::height => self.height,
            Real::inflow => self.inflow,
            Real::level => self.level,
            Real::der_level => self.rate(),
        }
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        match variable {
            Real::area if value > 0.0 => self.area = value,
            Real::area => return Err(variable.variable().refuse(value, "a number above 0")),
            Real::height => self.height = value,
            Real::inflow => self.inflow = value,
            Real::level => self.initial_level = value,
            Real::der_level => unreachable!("an output that is calculated is never set"),
        }
        Ok(())
    }

    fn get_integer(&self, Integer::overflows: Integer) -> i32 {
        self.overflows
    }

    fn get_boolean(&self, variable: Boolean) -> bool {
        match variable {
            Boolean::valve => self.valve,
            Boolean::full => self.level >= self.height,
        }
    }

    fn set_boolean(&mut self, variable: Boolean, value: bool) -> Result<(), Refusal> {
        match variable {
            Boolean::valve => self.valve = value,
            Boolean::full => unreachable!("an output that is calculated is never set"),
        }
        Ok(())
    }

    fn get_string(&self, String::label: String) -> &str {
        &self.label
    }

    fn set_string(&mut self, variable: String, value: &str) -> Result<(), Refusal> {
        if value.is_empty() {
            return Err(variable.variable().refuse("\"\"", "text that is not empty"));
        }
        self.label = value.into();
        Ok(())
    }

    fn initialise(&mut self, _start_time: f64, _log: &Log) -> Result<(), Refusal> {
        if !(0.0..=self.height).contains(&self.initial_level) {
            let allowed = format!("a level between 0 and height = {} m", self.height);
            return Err(Real::level.variable().refuse(self.initial_level, &allowed));
        }
        self.level = self.initial_level;
        self.overflows = 0;
        Ok(())
    }

    fn step(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal> {
        let level = self.level + self.rate() * step;
        if level < 0.0 {
            return Err(Refusal::discard(format!(
                "{} runs dry before {} s",
                self.label,
                time + step
            )));
        }
        if level > self.height && self.level < self.height {
            self.overflows += 1;
            log.tell(category::logEvents, format_args!("{} is 100% full", self.label));
        }
        self.level = level.min(self.height);
        Ok(())
    }

    fn get_real_output_derivative(&self, variable: Real, order: u32) -> Result<f64, Refusal> {
        match (variable, order) {
            (Real::level, 1) => Ok(self.rate()),
            _ => Ok(0.0),
        }
    }

    fn partial_derivative(&self, unknown: Real, known: Real) -> Result<f64, Refusal> {
        match (unknown, known) {
            (Real::der_level, Real::inflow) => Ok(f64::from(self.valve) / self.area),
            _ => Ok(0.0),
        }
    }

    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        archive.whole(self)
    }
}

fmi2_component::export!(Tank);
