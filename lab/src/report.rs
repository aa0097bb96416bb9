//! The files of a run, and their figures.

mod figure;
mod figures;
mod files;
mod theme;

pub use figures::{fitted, responses, structure, theory};
pub use files::{ReportError, identification_files, map_files, tracked_files};
