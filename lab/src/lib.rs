//! The lab of the LO–VI NES test bench: the parts that the program `vines` puts together, under one name.

#![forbid(unsafe_code)]

// The command line uses the library under the name that its users see.
extern crate self as vines;

pub mod cli;
mod files;
pub mod fmu_rig;
pub mod pack;
pub mod regime_map;
pub(crate) mod report;
pub(crate) mod table;

pub(crate) use files::{FileError, ResultFolder, create_folder_of, writable, write_file};
pub use vines_bench::{
    advice, backbone, cells, comparison, experiment, fit, identification, knowledge, linear, live, loop_check, plan,
    record, rig, scene, survey,
};
pub use vines_fmu as fmu;
pub use vines_helic as helic;
pub use vines_model::{ArgumentError, curves, map, numerics, orbit, regime, theory};
pub use vines_net as net;
pub use vines_rig::unit;
