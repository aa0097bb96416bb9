//! The progress of a sweep, and the flag that stops it.

use std::{
    io::{self, ErrorKind},
    path::Path,
    sync::{
        Mutex, OnceLock,
        atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    },
};

use crate::cell::Cell;

/// Number of damaged files that are named.
const NAMED: usize = 10;

/// The progress of a sweep, and the flag that stops it.
#[derive(Debug, Default)]
pub struct Monitor {
    /// Cells that were in the store, undamaged.
    pub found: AtomicU64,
    /// Cells computed since the start.
    pub computed: AtomicU64,
    /// Number of computed cells that failed.
    pub failed: AtomicU64,
    /// Cells that were inferred; known at the end of an adaptive sweep.
    pub inferred: AtomicU64,
    /// Ends the sweep within the duration of a cell; unfinished chunks are dropped.
    pub stop: AtomicBool,
    /// Reason of the first failure.
    pub reason: OnceLock<String>,
    /// Damaged files, and what is wrong with them.
    damaged: Mutex<Vec<String>>,
}

impl Monitor {
    /// Whether the sweep should end.
    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(Relaxed)
    }

    /// Counts a cell that was computed.
    pub(crate) fn note(&self, cell: &Cell) {
        self.computed.fetch_add(1, Relaxed);
        if !cell.failure.is_empty() {
            self.failed.fetch_add(1, Relaxed);
            let _ = self.reason.set(cell.failure.clone());
        }
    }

    /// Notes a file that is damaged or missing.
    pub(crate) fn damaged(&self, file: &Path, error: &io::Error) {
        let fault = match error.kind() {
            ErrorKind::NotFound => "is missing".into(),
            ErrorKind::UnexpectedEof => "is truncated".into(),
            _ => format!("is damaged ({error})"),
        };
        if let Ok(mut damaged) = self.damaged.lock() {
            damaged.push(format!("{} {fault}", file.display()));
        }
    }

    /// The damaged files that were found in stores, and what is wrong with them; None if there are none.
    #[must_use]
    pub fn damage(&self) -> Option<String> {
        let damaged = self.damaged.lock().ok()?;
        let files = match damaged.len() {
            0 => return None,
            1 => "1 damaged or incomplete file".to_string(),
            count => format!("{count} damaged or incomplete files"),
        };
        let more = if damaged.len() > NAMED { "; ..." } else { "" };
        Some(format!(
            "{files}: {}{more}",
            damaged[..damaged.len().min(NAMED)].join("; ")
        ))
    }
}
