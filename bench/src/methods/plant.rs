//! This project's plant, stepped in four ways.

use lovines::Plant;

use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

pub fn begin(scene: &Scene) -> Result<Plant, Failure> {
    let mut plant =
        Plant::new(scene.parameters, scene.state()).map_err(|e| Failure(e.to_string()))?;
    if let Some(first) = scene.steps.first() {
        plant.begin(first.drive());
    }
    Ok(plant)
}

fn state(plant: &Plant) -> [f64; 4] {
    let s = plant.state();
    [s.q1, s.dq1, s.q2, s.dq2]
}

macro_rules! methods {
    ($($(#[$meta:meta])* $name:ident: $step:expr, $steps:expr;)*) => {
        $($(#[$meta])*
        pub struct $name(Plant);

        impl Method for $name {
            fn start(scene: &Scene, _setting: f64) -> Result<Self, Failure> {
                begin(scene).map(Self)
            }

            fn step(&mut self, step: &Step) -> Result<(), Failure> {
                let advance: fn(&mut Plant, &Step) = $step;
                advance(&mut self.0, step);
                Ok(())
            }

            fn state(&self) -> [f64; 4] {
                state(&self.0)
            }

            fn impacts(&self) -> u64 {
                self.0.tally().impacts
            }

            fn steps(steps: &[Step]) -> Vec<Step> {
                let change: fn(&[Step]) -> Vec<Step> = $steps;
                change(steps)
            }
        })*
    };
}

fn advance(plant: &mut Plant, step: &Step) {
    plant.advance(step.drive(), step.duration);
}

methods! {
    /// One step of the plant for each of the scene's.
    AsAsked: advance, <[Step]>::to_vec;
    /// Everything in one step; the output is the end alone.
    OneStep: advance, in_one;
    /// 100 steps for each of the scene's, with v and the base displacement read after each.
    Sampled: |plant, step| {
        let part = Step { duration: step.duration / 100.0, ..*step };
        for _ in 0..100 {
            advance(plant, &part);
            std::hint::black_box((plant.centre(), plant.base_displacement()));
        }
    }, <[Step]>::to_vec;
    /// The general search for every contact, and nothing worked out in advance.
    ///
    /// A third derivative of the input of 5e-324 moves nothing, and is no harmonic drive: the quick way refuses it.
    General: |plant, step| {
        let mut drive = step.drive();
        drive.signal[3] = f64::from_bits(1);
        plant.advance(drive, step.duration);
    }, <[Step]>::to_vec;
}

/// Equal drives in a single step. Its length is rounded once, and not at every addition.
pub fn in_one(steps: &[Step]) -> Vec<Step> {
    let equal = |a: &Step, b: &Step| a == b;
    let joined = |run: &[Step]| Step {
        duration: run[0].duration * run.len() as f64,
        ..run[0]
    };
    steps.chunk_by(equal).map(joined).collect()
}
