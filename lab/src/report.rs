//! Results for people and programs: files, figures and tables.

mod figure;
mod figures;
mod files;
pub mod summary;
mod table;
mod theme;

pub use figure::Figure;
pub use figures::{fitted, responses, theory};
pub use files::{ReportError, write, write_interrupted, write_map, write_tracked};
pub use table::{Table, number, row, with_uncertainty};
