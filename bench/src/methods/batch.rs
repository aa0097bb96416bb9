//! This project's plants by the batch: many equal ones at once, of which the last is looked at.

use lovines::batch::{Batch, WIDTH};
use lovines::{Drive, Plant};

use super::plant::{begin, in_one};
use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

/// So many plants go abreast on one core.
const ON_ONE_CORE: usize = 4 * WIDTH;

/// So many plants that every core has something to do.
fn on_all_cores() -> usize {
    8 * WIDTH * std::thread::available_parallelism().map_or(1, usize::from)
}

fn read(plant: &Plant) -> [f64; 4] {
    let s = plant.state();
    [s.q1, s.dq1, s.q2, s.dq2]
}

macro_rules! methods {
    ($($(#[$meta:meta])* $name:ident: $count:expr, $advance:ident, $steps:expr;)*) => {
        $($(#[$meta])*
        pub struct $name(Batch, Drive);

        impl Method for $name {
            fn start(scene: &Scene, _setting: f64) -> Result<Self, Failure> {
                let plant = begin(scene)?;
                let first = scene.steps.first().map_or(Drive::default(), Step::drive);
                Ok(Self(Batch::new((0..$count).map(|_| (plant, first))), first))
            }

            fn step(&mut self, step: &Step) -> Result<(), Failure> {
                if self.1 != step.drive() {
                    self.1 = step.drive();
                    for index in 0..$count {
                        self.0.set_drive(index, self.1);
                    }
                }
                self.0.$advance(step.duration);
                // The same output as of all the others: every plant's state.
                for plant in self.0.plants() {
                    std::hint::black_box(read(plant));
                }
                Ok(())
            }

            fn state(&self) -> [f64; 4] {
                self.0.plants().last().map_or([f64::NAN; 4], read)
            }

            fn impacts(&self) -> u64 {
                self.0.plants().last().map_or(0, |plant| plant.tally().impacts)
            }

            fn at_once() -> usize {
                $count
            }

            fn steps(steps: &[Step]) -> Vec<Step> {
                let change: fn(&[Step]) -> Vec<Step> = $steps;
                change(steps)
            }
        })*
    };
}

methods! {
    /// On one core.
    OneCore: ON_ONE_CORE, advance_on_one_core, <[Step]>::to_vec;
    /// On one core, everything in one step.
    InOneStep: ON_ONE_CORE, advance_on_one_core, in_one;
    /// On all cores.
    AllCores: on_all_cores(), advance, <[Step]>::to_vec;
}
