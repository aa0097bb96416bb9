//! This project's plant, stepped in four ways.

use lovines::Plant;

use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

pub fn begin(scene: &Scene) -> Result<Plant, Failure> {
    let mut plant = Plant::new(scene.parameters, scene.state()).map_err(|e| Failure(e.to_string()))?;
    if let Some(first) = scene.steps.first() {
        plant.begin(first.drive()).map_err(|e| Failure(e.to_string()))?;
    }
    Ok(plant)
}

fn state(plant: &Plant) -> [f64; 4] {
    let s = plant.state();
    [s.q1, s.dq1, s.q2, s.dq2]
}

macro_rules! methods {
    ($($(#[$meta:meta])* $name:ident: $fast:expr, $step:expr, $steps:expr;)*) => {
        $($(#[$meta])*
        pub struct $name(Plant);

        impl Method for $name {
            fn start(scene: &Scene, _setting: f64) -> Result<Self, Failure> {
                let mut plant = begin(scene)?;
                plant.set_fast_path($fast);
                Ok(Self(plant))
            }

            fn step(&mut self, step: &Step) -> Result<(), Failure> {
                let advance: fn(&mut Plant, &Step) -> Result<(), Failure> = $step;
                advance(&mut self.0, step)
            }

            fn state(&self) -> [f64; 4] {
                state(&self.0)
            }

            fn impacts(&self) -> u64 {
                self.0.totals().impacts
            }

            fn steps(steps: &[Step]) -> Vec<Step> {
                let change: fn(&[Step]) -> Vec<Step> = $steps;
                change(steps)
            }
        })*
    };
}

fn advance(plant: &mut Plant, step: &Step) -> Result<(), Failure> {
    match plant.advance(step.drive(), step.duration) {
        Ok(_) => Ok(()),
        Err(error) => Err(Failure(error.to_string())),
    }
}

methods! {
    /// One step of the plant for each of the scene's.
    AsAsked: true, advance, <[Step]>::to_vec;
    /// Everything in one step; the output is the end alone.
    OneStep: true, advance, in_one;
    /// 100 steps for each of the scene's, with v and the base displacement read after each.
    Sampled: true, |plant, step| {
        let part = Step { duration: step.duration / 100.0, ..*step };
        for _ in 0..100 {
            advance(plant, &part)?;
            std::hint::black_box((plant.centre(), plant.base_displacement()));
        }
        Ok(())
    }, <[Step]>::to_vec;
    /// The plain solver: certified search for every contact, and nothing kept between steps.
    General: false, advance, <[Step]>::to_vec;
}

/// Equal drives in a single step. Its length is rounded once, and not at every addition.
fn in_one(steps: &[Step]) -> Vec<Step> {
    let equal = |a: &Step, b: &Step| a == b;
    let joined = |run: &[Step]| Step { duration: run[0].duration * run.len() as f64, ..run[0] };
    steps.chunk_by(equal).map(joined).collect()
}
