//! The simulated rigs, their faults and measurement chain, what the bench makes of the readings of any rig, and the built-in controller.

mod built_in;
mod chain;
mod faulty;
mod oscillator;
mod reference_control;
mod stages;
mod structure;

pub use built_in::BuiltIn;
pub use chain::Chain;
pub use faulty::{RigFault, SensorFault, faulty};
pub use oscillator::Simulated;
pub(crate) use reference_control::OFF;
pub(crate) use stages::Scaled;
pub use stages::{Interrupted, Measured, SensorsOnly, Stoppable};
pub(crate) use structure::ShakerFault;
pub use structure::SimulatedStructure;
pub use vines_rig::{
    Clock, Command, Controller, ControllerError, Drive, Fault, FrictionTotals, GroundTruth, LoopState, Move, Rig,
    RigError, RigStage, Sensors,
};
pub use vines_scene::knowledge::has_friction;
