//! Results for people and programs: files, figures, tables, and one page with all of them.

mod figure;
mod figures;
mod files;
mod page;
mod section;
mod sections;
mod study;
pub mod summary;
mod table;
mod theme;

pub use figure::FigureError;
pub use files::{ReportError, decay_csv, map_csv, write, write_interrupted, write_lateness, write_map, write_tracked};
pub use section::{Block, Maker, Section, Subject};
pub use sections::SECTIONS;
pub use study::{Report, write_report};
pub use table::{Table, number, with_uncertainty};
pub use theme::dark;
