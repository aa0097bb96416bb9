//! The engine of a sweep with a store: computes its chunks on all cores, verifies and merges stores, and reports the progress.

use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use rayon::prelude::*;

use crate::{
    adaptive,
    cell::Cell,
    store::{Chunk, Fault, Store, StoreError},
    sweep::{Shard, Sweep},
};

/// Computes the chunks of a part of `sweep` that its store in `folder` does not have, or whose files are damaged. True if all are there at
/// the end; false if the monitor stopped it.
///
/// # Errors
/// A folder that cannot be used.
pub fn run(sweep: &Sweep, folder: &Path, shard: Shard, monitor: &Monitor) -> Result<bool, StoreError> {
    let opened = Store::open(sweep, folder, shard, monitor);
    if monitor.stop.load(Relaxed) {
        return Ok(false);
    }
    let store = opened?;
    if let Some(stride) = sweep.settings().adaptive {
        if shard != Shard::ALL {
            return Err(StoreError::Part);
        }
        if count(sweep, &store, shard, monitor) == sweep.cells() {
            store.tidy()?;
            return Ok(true);
        }
        monitor.found.store(0, Relaxed);
        return adaptive::run(sweep, &store, stride as usize, monitor);
    }
    for n in shard.chunks(sweep) {
        let index = sweep.chunk_index(n);
        if let Chunk::Complete(_) = store.chunk(&index, monitor) {
            monitor.found.fetch_add(sweep.chunk_cells(&index), Relaxed);
            continue;
        }
        let Some(cells) = chunk(sweep, &index, monitor) else {
            return Ok(false);
        };
        store.write(&index, &cells)?;
    }
    if shard == Shard::ALL {
        store.tidy()?;
    }
    Ok(true)
}

/// Verifies a part of the store of `sweep` in `folder`, and counts its undamaged cells; nothing is written. The monitor has the damage.
///
/// # Errors
/// No store of this sweep.
pub fn verify(sweep: &Sweep, folder: &Path, shard: Shard, monitor: &Monitor) -> Result<bool, StoreError> {
    let store = Store::existing(sweep, folder)?;
    let inspected = store.inspect(sweep, shard, monitor);
    if monitor.stop.load(Relaxed) {
        return Ok(false);
    }
    inspected?;
    count(sweep, &store, shard, monitor);
    Ok(!monitor.stop.load(Relaxed))
}

/// Counts the cells of undamaged chunks, until the monitor stops it.
fn count(sweep: &Sweep, store: &Store, shard: Shard, monitor: &Monitor) -> u64 {
    shard.chunks(sweep).par_bridge().for_each(|n| {
        let index = sweep.chunk_index(n);
        if !monitor.stop.load(Relaxed)
            && let Chunk::Complete(_) = store.chunk(&index, monitor)
        {
            monitor.found.fetch_add(sweep.chunk_cells(&index), Relaxed);
        }
    });
    monitor.found.load(Relaxed)
}

/// Copies the chunks that the store in `folder` does not have, or whose files are damaged, from other stores of the same sweep; [`run`] computes
/// those that none of them has.
///
/// # Errors
/// A folder that cannot be used, or a store of another sweep.
pub fn collect(sweep: &Sweep, folder: &Path, from: &[PathBuf], monitor: &Monitor) -> Result<(), StoreError> {
    let sources = from
        .iter()
        .map(|one| Store::existing(sweep, one))
        .collect::<Result<Vec<_>, _>>()?;
    let store = Store::open(sweep, folder, Shard::ALL, monitor)?;
    for index in (0..sweep.chunks()).map(|n| sweep.chunk_index(n)) {
        if matches!(store.chunk(&index, monitor), Chunk::Complete(_)) {
            continue;
        }
        let undamaged = sources.iter().find_map(|source| match source.chunk(&index, monitor) {
            Chunk::Complete(files) => Some(files),
            Chunk::Damaged | Chunk::Absent => None,
        });
        if let Some(files) = undamaged {
            store.copy(&index, &files)?;
        }
    }
    Ok(())
}

/// All cells of a chunk; None if it was stopped.
fn chunk(sweep: &Sweep, index: &[u64], monitor: &Monitor) -> Option<Vec<Cell>> {
    (0..sweep.chunk_size() as u64)
        .into_par_iter()
        .map(|n| {
            if monitor.stop.load(Relaxed) {
                return None;
            }
            let cell = sweep.cell(index, n);
            monitor.note(&cell);
            Some(cell)
        })
        .collect()
}

/// What a sweep will cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Number of cells.
    pub cells: u64,
    /// Duration on this machine, h.
    pub hours: f64,
    /// Size before compression, bytes.
    pub bytes: f64,
}

impl Estimate {
    /// Above this, a sweep may be a mistake: it must be confirmed.
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.hours > 2.0 || self.bytes > 2e10
    }
}

/// All cells of a trial fail; the reason is the first cell's.
#[derive(Debug, thiserror::Error)]
#[error("all of {tried} cells that were tried fail: {reason}")]
pub struct EstimateError {
    tried: usize,
    reason: String,
}

/// Largest number of cells, and duration, of the trial behind an estimate.
const TRIED: usize = 64;
const TRIAL: Duration = Duration::from_secs(1);

/// Estimates the cost of a sweep from a few of its cells; the flag ends it early.
///
/// # Errors
/// If all of them fail: the reason of the first.
pub fn estimate(sweep: &Sweep, stop: &AtomicBool) -> Result<Estimate, EstimateError> {
    let start = Instant::now();
    // Positions that do not follow a regular grid: the golden ratio.
    let tried: Vec<Cell> = (0..TRIED)
        .map(|n| (0.5 + 0.618_033_988_749_895 * n as f64).fract())
        .take_while(|n| *n == 0.5 || start.elapsed() < TRIAL && !stop.load(Relaxed))
        .map(|position| sweep.cell_near(position))
        .collect();
    if tried.iter().all(|cell| !cell.failure.is_empty()) {
        let reason = tried.first().map_or(String::new(), |cell| cell.failure.clone());
        return Err(EstimateError { tried: tried.len(), reason });
    }
    let cell = start.elapsed().as_secs_f64() / tried.len() as f64;
    let threads = rayon::current_num_threads() as f64;
    Ok(Estimate {
        cells: sweep.cells(),
        hours: sweep.cells() as f64 * cell / threads / 3600.0,
        bytes: sweep.bytes(),
    })
}

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
