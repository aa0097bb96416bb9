//! The engine of a sweep with a store: computes its chunks on all cores, verifies and merges stores, and estimates the cost.

use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering::Relaxed},
    time::{Duration, Instant},
};

use rayon::prelude::*;
use vines_model::ArgumentError;

use crate::{
    adaptive,
    cell::Cell,
    monitor::Monitor,
    store::{Store, StoreError},
    sweep::{Shard, Sweep},
};

/// Computes the chunks of a part of `sweep` that its store in `folder` does not have, or whose files are damaged. True if all are there at
/// the end; false if the monitor stopped it.
///
/// # Errors
/// A folder that cannot be used.
pub fn run(sweep: &Sweep, folder: &Path, shard: Shard, monitor: &Monitor) -> Result<bool, StoreError> {
    let stride = sweep.settings().adaptive;
    if stride.is_some() && shard != Shard::ALL {
        return Err(StoreError::Part);
    }
    let store = Store::open(sweep, folder, shard, monitor)?;
    let complete = match stride {
        None => compute(sweep, &store, shard, monitor)?,
        Some(_) if count(sweep, &store, shard, monitor) == sweep.cells() => true,
        Some(stride) => {
            monitor.found.store(0, Relaxed);
            adaptive::run(sweep, &store, stride as usize, monitor)?
        }
    };
    if complete && shard == Shard::ALL {
        store.tidy()?;
    }
    Ok(complete)
}

/// Computes the chunks of a part that are missing or damaged. False if the monitor stopped it.
fn compute(sweep: &Sweep, store: &Store, shard: Shard, monitor: &Monitor) -> Result<bool, StoreError> {
    for index in shard.chunks(sweep) {
        if store.chunk(&index, monitor).is_some() {
            monitor.found.fetch_add(sweep.chunk_count(&index), Relaxed);
        } else if !store.fill(&index, |index| sweep.counted_cell(index, monitor))? {
            return Ok(false);
        }
    }
    // A part without chunks may have been stopped before.
    Ok(!monitor.stopped())
}

/// Verifies a part of the store of `sweep` in `folder`, and counts its undamaged cells; nothing is written. The monitor has the damage.
///
/// # Errors
/// No store of this sweep.
pub fn verify(sweep: &Sweep, folder: &Path, shard: Shard, monitor: &Monitor) -> Result<bool, StoreError> {
    let store = Store::existing(sweep, folder)?;
    store.check(shard, monitor, |key, error, _| {
        monitor.damaged(&folder.join(key), error);
        Ok(())
    })?;
    count(sweep, &store, shard, monitor);
    Ok(!monitor.stopped())
}

/// Counts the cells of undamaged chunks, until the monitor stops it.
fn count(sweep: &Sweep, store: &Store, shard: Shard, monitor: &Monitor) -> u64 {
    shard.chunks(sweep).par_bridge().for_each(|index| {
        if !monitor.stopped() && store.chunk(&index, monitor).is_some() {
            monitor.found.fetch_add(sweep.chunk_count(&index), Relaxed);
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
    let sources = from.iter().map(|folder| Store::existing(sweep, folder));
    let sources: Vec<Store> = sources.collect::<Result<_, _>>()?;
    let store = Store::open(sweep, folder, Shard::ALL, monitor)?;
    for index in Shard::ALL.chunks(sweep) {
        if store.chunk(&index, monitor).is_none()
            && let Some(content) = sources.iter().find_map(|source| source.chunk(&index, monitor))
        {
            store.copy_chunk(&index, &content)?;
        }
    }
    Ok(())
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

/// Largest number of cells, and duration, of the trial behind an estimate.
const TRIED: usize = 64;
const TRIAL: Duration = Duration::from_secs(1);

/// Estimates the cost of a sweep from a few of its cells; the flag ends it early.
///
/// # Errors
/// If all of them fail: the reason of the first.
pub fn estimate(sweep: &Sweep, stop: &AtomicBool) -> Result<Estimate, ArgumentError> {
    let (start, cells) = (Instant::now(), sweep.cells());
    // Positions that do not follow a regular grid: the golden ratio.
    let positions = (0..TRIED).map(|n| (0.5 + 0.618_033_988_749_895 * n as f64).fract());
    let tried: Vec<Cell> = positions
        .take_while(|n| *n == 0.5 || start.elapsed() < TRIAL && !stop.load(Relaxed))
        .map(|position| sweep.cell(&sweep.cell_index((position * cells as f64) as u64)))
        .collect();
    if tried.iter().all(|cell| !cell.failure.is_empty()) {
        let (tried, reason) = (tried.len(), &tried[0].failure);
        return Err(format!("all of {tried} cells that were tried fail: {reason}").into());
    }
    let seconds = cells as f64 * start.elapsed().as_secs_f64() / tried.len() as f64;
    let hours = seconds / rayon::current_num_threads() as f64 / 3600.0;
    Ok(Estimate { cells, hours, bytes: sweep.bytes() })
}
