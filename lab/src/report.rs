//! Results for people and programs: files, figures and tables.

mod figure;
mod figures;
mod files;
pub mod summary;
mod table;
mod theme;

pub use files::{
    ReportError, write, write_fit, write_interrupted, write_map, write_response, write_theory, write_tracked,
};
pub use table::{Table, number, row, with_uncertainty};
