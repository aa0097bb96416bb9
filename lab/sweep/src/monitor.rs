//! The progress of a sweep, which other threads read.

use std::sync::{
    Mutex,
    atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
};

use crate::cell::Cell;

/// The progress of a sweep, and the flag that stops it.
#[derive(Debug, Default)]
pub struct Monitor {
    /// Cells that were in the store at the start.
    pub found: AtomicU64,
    /// Cells computed since then.
    pub computed: AtomicU64,
    /// Those of them that failed.
    pub failed: AtomicU64,
    /// Cells that were inferred; known at the end of an adaptive sweep.
    pub inferred: AtomicU64,
    /// Ends the sweep within the duration of a cell; unfinished chunks are dropped.
    pub stop: AtomicBool,
    /// Reason of the first failure.
    pub reason: Mutex<Option<String>>,
}

impl Monitor {
    /// Counts a cell.
    pub(crate) fn note(&self, cell: &Cell) {
        if !cell.failure.is_empty() {
            self.failed.fetch_add(1, Relaxed);
            if let Ok(mut reason) = self.reason.lock() {
                reason.get_or_insert_with(|| cell.failure.clone());
            }
        }
        if cell.regime.is_some() || !cell.failure.is_empty() {
            self.computed.fetch_add(1, Relaxed);
        }
    }
}
