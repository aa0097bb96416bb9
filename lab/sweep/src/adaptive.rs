//! Adaptive refinement: the regime is computed where neighbouring cells differ, and inferred elsewhere.
//!
//! A grid of distant cells comes first. The neighbours of every pair that differs are computed until borders are surrounded by equal
//! cells; then the distance is halved, and a new cell takes the regime of the neighbour before it. An island that lies between the cells of
//! the first grid is missed; `inferred` marks what was not computed. What is computed next follows from the results so far, so that a
//! sweep that was killed reads the results of its rounds again and continues.

use std::{collections::BTreeMap, sync::atomic::Ordering::Relaxed};

use rayon::prelude::*;
use vines_model::regime::Regime;

use crate::{
    cell::{ABSENT, Cell, FAILED, code},
    run::Monitor,
    store::{ROUNDS, Store, StoreError},
    sweep::Sweep,
};

/// Smallest number of cells of the first grid along a side, roughly.
const SIDE: usize = 4;

/// A cell as a round keeps it: its number, row by row, the code of its regime, and why it failed.
type Computed = (usize, u8, String);

/// Computes the store of an adaptive sweep. False if the monitor stopped it.
pub(crate) fn run(sweep: &Sweep, store: &Store, stride: usize, monitor: &Monitor) -> Result<bool, StoreError> {
    let [rows, columns] = [sweep.shape[0] as usize, sweep.shape[1] as usize];
    let grid = |stride: usize| {
        let rows = (0..rows).step_by(stride);
        rows.flat_map(move |row| (0..columns).step_by(stride).map(move |column| row * columns + column))
    };
    let neighbours = |n: usize, stride: usize| {
        let (row, column) = (n / columns, n % columns);
        let near = [
            (row.checked_sub(stride), Some(column)),
            (row.checked_add(stride), Some(column)),
            (Some(row), column.checked_sub(stride)),
            (Some(row), column.checked_add(stride)),
        ];
        let inside =
            move |(row, column): (Option<usize>, Option<usize>)| Some((row.filter(|row| *row < rows)?, column?));
        let cells = near.into_iter().filter_map(inside);
        cells
            .filter(move |cell| cell.1 < columns)
            .map(move |(row, column)| row * columns + column)
    };
    let mut codes = vec![ABSENT; rows * columns];
    let (mut computed, mut failures) = (vec![false; rows * columns], BTreeMap::new());
    let mut stride = stride.min((rows.min(columns) / SIDE).max(1).next_power_of_two());
    let mut next: Vec<usize> = grid(stride).collect();
    let mut round = 0;
    loop {
        for (batch, cells) in next.chunks(sweep.chunk_size()).enumerate() {
            let Some(results) = results(sweep, store, &format!("{ROUNDS}/{round}-{batch}"), cells, monitor)? else {
                return Ok(false);
            };
            for (n, code, failure) in results {
                (codes[n], computed[n]) = (code, true);
                if !failure.is_empty() {
                    failures.insert(n, failure);
                }
            }
        }
        round += 1;
        // Only a cell that was computed, or its neighbour, can differ now; on a new grid, any.
        let mut candidates: Vec<usize> = next.iter().flat_map(|n| neighbours(*n, stride).chain([*n])).collect();
        loop {
            candidates.sort_unstable();
            candidates.dedup();
            let differs = |n: &usize| neighbours(*n, stride).any(|other| codes[other] != codes[*n]);
            candidates.retain(|n| !computed[*n] && differs(n));
            if !candidates.is_empty() {
                break;
            }
            if stride == 1 {
                return write(sweep, store, &codes, &computed, &failures, monitor);
            }
            for n in grid(stride / 2) {
                let (row, column) = (n / columns, n % columns);
                if codes[n] == ABSENT {
                    codes[n] = codes[(row - row % stride) * columns + column - column % stride];
                }
            }
            stride /= 2;
            candidates = grid(stride).collect();
        }
        next = candidates;
    }
}

/// Computes cells, or reads what was kept of them. `None` if the monitor stopped it.
fn results(
    sweep: &Sweep,
    store: &Store,
    key: &str,
    cells: &[usize],
    monitor: &Monitor,
) -> Result<Option<Vec<Computed>>, StoreError> {
    let kept = store.kept(key, monitor);
    if let Some(results) = kept.and_then(|text| serde_json::from_slice(&text).ok()) {
        monitor.found.fetch_add(cells.len() as u64, Relaxed);
        return Ok(Some(results));
    }
    let compute = |n: &usize| {
        (!monitor.stop.load(Relaxed)).then(|| {
            let cell = sweep.cell_at(&[*n as u64 / sweep.shape[1], *n as u64 % sweep.shape[1]]);
            monitor.note(&cell);
            (*n, code(&cell), cell.failure)
        })
    };
    let results: Option<Vec<Computed>> = cells.par_iter().map(compute).collect();
    if let Some(results) = &results {
        store.keep(key, &serde_json::to_vec(results).unwrap_or_default())?;
    }
    Ok(results)
}

/// Writes all chunks. False if the monitor stopped it.
fn write(
    sweep: &Sweep,
    store: &Store,
    codes: &[u8],
    computed: &[bool],
    failures: &BTreeMap<usize, String>,
    monitor: &Monitor,
) -> Result<bool, StoreError> {
    let cell = |index: Vec<u64>| {
        let n = (index[0] * sweep.shape[1] + index[1]) as usize;
        let beside = (codes[n] == FAILED).then(|| "not computed, as a neighbouring cell failed".to_string());
        Cell {
            regime: Regime::SIMULATED.get(usize::from(codes[n])).copied(),
            inferred: !computed[n],
            failure: failures.get(&n).cloned().or(beside).unwrap_or_default(),
            ..Cell::default()
        }
    };
    for index in (0..sweep.chunks()).map(|n| sweep.chunk_index(n)) {
        if monitor.stop.load(Relaxed) {
            return Ok(false);
        }
        let cells: Vec<Cell> = (0..sweep.chunk_size() as u64)
            .map(|n| sweep.cell_index(&index, n).map_or_else(Cell::default, cell))
            .collect();
        store.write(&index, &cells)?;
    }
    let inferred = computed.iter().filter(|computed| !**computed).count();
    monitor.inferred.store(inferred as u64, Relaxed);
    store.tidy()?;
    Ok(true)
}
