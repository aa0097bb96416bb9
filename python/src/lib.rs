//! The compiled part of the Python package: thin functions; `vines/*.py` has the interface with its documentation.

mod experiments;
mod files;
mod number;
mod plants;
mod saved;
mod scene;
mod structures;
mod sweeps;
mod wait;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<plants::Plant>()?;
    module.add_class::<plants::Plants>()?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<structures::StructurePlant>()?;
    module.add_class::<experiments::PhaseLock>()?;
    module.add_class::<sweeps::Cells>()?;
    for function in [
        wrap_pyfunction!(plants::plant_table, module)?,
        wrap_pyfunction!(experiments::identify, module)?,
        wrap_pyfunction!(experiments::backbone, module)?,
        wrap_pyfunction!(experiments::fit, module)?,
        wrap_pyfunction!(experiments::linear_decay, module)?,
        wrap_pyfunction!(experiments::recording, module)?,
        wrap_pyfunction!(files::command_line, module)?,
        wrap_pyfunction!(files::is_unit, module)?,
        wrap_pyfunction!(files::truth, module)?,
        wrap_pyfunction!(files::si, module)?,
        wrap_pyfunction!(files::table, module)?,
        wrap_pyfunction!(files::utf8, module)?,
        wrap_pyfunction!(experiments::orbits, module)?,
        wrap_pyfunction!(experiments::theory, module)?,
        wrap_pyfunction!(experiments::regime, module)?,
        wrap_pyfunction!(sweeps::regimes, module)?,
        wrap_pyfunction!(sweeps::unit, module)?,
    ] {
        module.add_function(function)?;
    }
    module.add("version", env!("CARGO_PKG_VERSION"))
}
