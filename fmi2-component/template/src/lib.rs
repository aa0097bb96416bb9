//! A first-order lag, T y' + y = u, exact for an input that is constant during a step.
use fmi2_component::{Component, Key, Log, Refusal};
use variables::{Model, Real};

mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

#[derive(Clone, Default)]
struct Lag {
    values: [f64; 3],
}

impl Component for Lag {
    type Model = Model;

    fn new() -> Self {
        Self::default()
    }

    fn get_real(&self, variable: Real) -> f64 {
        self.values[variable as usize]
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        if matches!(variable, Real::T) && value <= 0.0 {
            return Err(variable.variable().refuse(value, "a time above 0 s"));
        }
        self.values[variable as usize] = value;
        Ok(())
    }

    fn initialise(&mut self, _start_time: f64, _log: &Log) -> Result<(), Refusal> {
        Ok(())
    }

    fn step(&mut self, _time: f64, step: f64, _log: &Log) -> Result<(), Refusal> {
        let [time_constant, u, y] = &mut self.values;
        *y = *u + (*y - *u) * (-step / *time_constant).exp();
        Ok(())
    }
}

fmi2_component::export!(Lag);
