//! The shell through its C functions, with the example component: values, life cycle, FMU states, instantiation and logging.

mod fmu_state;
mod instantiate;
mod life_cycle;
mod values;

use fmi2_boundary::{Fmu, Interface, Master};

/// A tank that has been instantiated.
fn new() -> Master {
    Master::new(&Fmu::tank(), Interface::CoSimulation)
}

/// A tank that is ready to step.
fn ready() -> Master {
    Master::ready(&Fmu::tank())
}
