//! The progress of a sweep, which other threads read.

use std::{
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    },
};

use crate::{cell::Cell, gzip::Fault};

/// Number of damaged files that are named.
const NAMED: usize = 10;

/// The progress of a sweep, and the flag that stops it.
#[derive(Debug, Default)]
pub struct Monitor {
    /// Cells that were in the store, undamaged.
    pub found: AtomicU64,
    /// Cells computed since the start.
    pub computed: AtomicU64,
    /// Those of them that failed.
    pub failed: AtomicU64,
    /// Cells that were inferred; known at the end of an adaptive sweep.
    pub inferred: AtomicU64,
    /// Ends the sweep within the duration of a cell; unfinished chunks are dropped.
    pub stop: AtomicBool,
    /// Reason of the first failure.
    pub reason: Mutex<Option<String>>,
    /// Number of damaged files, and what is wrong with the first of them.
    damage: Mutex<(u64, Vec<String>)>,
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
        if cell.is_known() {
            self.computed.fetch_add(1, Relaxed);
        }
    }

    /// Counts a damaged file.
    pub(crate) fn damaged(&self, file: &Path, fault: &Fault) {
        if let Ok(mut damage) = self.damage.lock() {
            damage.0 += 1;
            if damage.1.len() < NAMED {
                damage.1.push(format!("{} {fault}", file.display()));
            }
        }
    }

    /// The damaged files that were found in stores, and what is wrong with them; None if there are none.
    #[must_use]
    pub fn damage(&self) -> Option<String> {
        let damage = self.damage.lock().ok()?;
        let (count, named) = &*damage;
        let files = match count {
            0 => return None,
            1 => "1 damaged or incomplete file: ".to_string(),
            _ => format!("{count} damaged or incomplete files: "),
        };
        let further = match count - named.len() as u64 {
            0 => String::new(),
            further => format!("; and {further} more"),
        };
        Some(files + &named.join("; ") + &further)
    }
}
