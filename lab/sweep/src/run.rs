//! Runs a sweep on all cores, chunk by chunk.

use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use rayon::prelude::*;

use crate::{
    adaptive,
    cell::Cell,
    error::StoreError,
    monitor::Monitor,
    plan::{Plan, Shard},
    store::{Chunk, Store},
};

/// Chunks that are computed at the same time for every eight threads: the last cells of one and the first of the next.
const AT_ONCE: usize = 2;

/// Computes the chunks of a part of `plan` that its store in `folder` does not have, or whose files are damaged. True if all are there at
/// the end; false if the monitor stopped it.
///
/// # Errors
/// A folder that cannot be used.
pub fn run(plan: &Plan, folder: &Path, shard: Shard, monitor: &Monitor) -> Result<bool, StoreError> {
    let opened = Store::open(plan, folder, shard, monitor);
    if monitor.stop.load(Relaxed) {
        return Ok(false);
    }
    let store = opened?;
    if let Some(stride) = plan.settings().adaptive {
        if shard != Shard::ALL {
            return Err(StoreError::Part);
        }
        if count(plan, &store, shard, monitor) == plan.cells() {
            store.tidy()?;
            return Ok(true);
        }
        monitor.found.store(0, Relaxed);
        return adaptive::run(plan, &store, stride as usize, monitor);
    }
    let next = Mutex::new(shard.chunks(plan));
    let error = Mutex::new(None);
    let work = || {
        loop {
            let n = next.lock().ok().and_then(|mut chunks| chunks.next());
            let Some(index) = n.filter(|_| !monitor.stop.load(Relaxed)).map(|n| plan.chunk_index(n)) else {
                return;
            };
            if let Chunk::Complete(_) = store.chunk(&index, monitor) {
                monitor.found.fetch_add(plan.chunk_cells(&index), Relaxed);
                continue;
            }
            let Some(cells) = chunk(plan, &index, monitor) else {
                return;
            };
            if let Err(failure) = store.write(&index, &cells) {
                monitor.stop.store(true, Relaxed);
                if let Ok(mut error) = error.lock() {
                    error.get_or_insert(failure);
                }
            }
        }
    };
    let at_once = AT_ONCE * rayon::current_num_threads().div_ceil(8);
    std::thread::scope(|scope| {
        for _ in 0..at_once {
            scope.spawn(work);
        }
    });
    match error.into_inner().unwrap_or_default() {
        Some(error) => Err(error),
        None if monitor.stop.load(Relaxed) => Ok(false),
        None => {
            if shard == Shard::ALL {
                store.tidy()?;
            }
            Ok(true)
        }
    }
}

/// Verifies a part of the store of `plan` in `folder`, and counts its undamaged cells; nothing is written. The monitor has the damage.
///
/// # Errors
/// No store of this sweep.
pub fn verify(plan: &Plan, folder: &Path, shard: Shard, monitor: &Monitor) -> Result<bool, StoreError> {
    let store = Store::existing(plan, folder)?;
    let inspected = store.inspect(plan, shard, monitor);
    if monitor.stop.load(Relaxed) {
        return Ok(false);
    }
    inspected?;
    count(plan, &store, shard, monitor);
    Ok(!monitor.stop.load(Relaxed))
}

/// Counts the cells of undamaged chunks, until the monitor stops it.
fn count(plan: &Plan, store: &Store, shard: Shard, monitor: &Monitor) -> u64 {
    shard.chunks(plan).par_bridge().for_each(|n| {
        let index = plan.chunk_index(n);
        if !monitor.stop.load(Relaxed)
            && let Chunk::Complete(_) = store.chunk(&index, monitor)
        {
            monitor.found.fetch_add(plan.chunk_cells(&index), Relaxed);
        }
    });
    monitor.found.load(Relaxed)
}

/// Collects the chunks of other stores of the same sweep, and computes those again that are damaged in all of them. Returns the number of
/// cells that are still missing.
///
/// # Errors
/// A folder that cannot be used, or a store of another sweep.
pub fn merge(plan: &Plan, folder: &Path, from: &[PathBuf], monitor: &Monitor) -> Result<u64, StoreError> {
    let sources = from
        .iter()
        .map(|one| Store::existing(plan, one))
        .collect::<Result<Vec<_>, _>>()?;
    let store = Store::open(plan, folder, Shard::ALL, monitor)?;
    let mut missing = 0;
    for index in (0..plan.chunks()).map(|n| plan.chunk_index(n)) {
        let mut damaged = match store.chunk(&index, monitor) {
            Chunk::Complete(_) => continue,
            Chunk::Damaged => true,
            Chunk::Absent => false,
        };
        let undamaged = sources.iter().find_map(|source| match source.chunk(&index, monitor) {
            Chunk::Complete(files) => Some(files),
            Chunk::Damaged => {
                damaged = true;
                None
            }
            Chunk::Absent => None,
        });
        match undamaged {
            Some(files) => store.copy(&index, &files)?,
            None if damaged => {
                if let Some(cells) = chunk(plan, &index, monitor) {
                    store.write(&index, &cells)?;
                }
            }
            None => missing += plan.chunk_cells(&index),
        }
    }
    if missing == 0 {
        store.tidy()?;
    }
    Ok(missing)
}

/// All cells of a chunk; None if it was stopped.
fn chunk(plan: &Plan, index: &[u64], monitor: &Monitor) -> Option<Vec<Cell>> {
    (0..plan.chunk_size() as u64)
        .into_par_iter()
        .map(|n| {
            if monitor.stop.load(Relaxed) {
                return None;
            }
            let cell = plan.cell(index, n);
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

/// All cells that were tried fail; the reason is that of the first.
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
pub fn estimate(plan: &Plan, stop: &AtomicBool) -> Result<Estimate, EstimateError> {
    let start = Instant::now();
    // Positions that do not follow a regular grid: the golden ratio.
    let tried: Vec<Cell> = (0..TRIED)
        .map(|n| (0.5 + 0.618_033_988_749_895 * n as f64).fract())
        .take_while(|n| *n == 0.5 || start.elapsed() < TRIAL && !stop.load(Relaxed))
        .map(|position| plan.cell_near(position))
        .collect();
    if tried.iter().all(|cell| !cell.failure.is_empty()) {
        let reason = tried.first().map_or(String::new(), |cell| cell.failure.clone());
        return Err(EstimateError { tried: tried.len(), reason });
    }
    let cell = start.elapsed().as_secs_f64() / tried.len() as f64;
    let threads = rayon::current_num_threads() as f64;
    Ok(Estimate {
        cells: plan.cells(),
        hours: plan.cells() as f64 * cell / threads / 3600.0,
        bytes: plan.bytes(),
    })
}
