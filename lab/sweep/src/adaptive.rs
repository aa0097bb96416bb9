//! Adaptive refinement: the regime is computed where neighbouring cells differ, and inferred elsewhere.
//!
//! A grid of distant cells comes first. The neighbours of every pair that differs are computed until borders are surrounded by equal
//! cells; then the distance is halved, and a new cell takes the regime of the neighbour before it. An island that lies between the cells of
//! the first grid is missed; `inferred` marks what was not computed. What is computed next follows from the results so far, so that a
//! sweep that was killed reads the results of its rounds again and continues.

use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;
use vines_model::regime::Regime;

use crate::{
    cell::{ABSENT, Cell, FAILED},
    monitor::Monitor,
    store::{ROUNDS, Store, StoreError},
    sweep::{Shard, Sweep},
};

/// Smallest number of cells of the first grid along a side, roughly.
const SIDE: usize = 4;

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
            (row >= stride).then(|| n - stride * columns),
            (row + stride < rows).then_some(n + stride * columns),
            (column >= stride).then(|| n - stride),
            (column + stride < columns).then_some(n + stride),
        ];
        near.into_iter().flatten()
    };
    let (mut codes, mut computed) = (vec![ABSENT; rows * columns], vec![false; rows * columns]);
    let mut stride = stride.min((rows.min(columns) / SIDE).max(1).next_power_of_two());
    let (mut candidates, mut round): (Vec<usize>, _) = (grid(stride).collect(), 0);
    loop {
        candidates.sort_unstable();
        candidates.dedup();
        let differs = |n: &usize| neighbours(*n, stride).any(|neighbour| codes[neighbour] != codes[*n]);
        candidates.retain(|n| !computed[*n] && (codes[*n] == ABSENT || differs(n)));
        if candidates.is_empty() {
            if stride == 1 {
                return write(sweep, store, &codes, &computed, monitor);
            }
            for n in grid(stride / 2).filter(|n| !computed[*n]) {
                let (row, column) = (n / columns, n % columns);
                codes[n] = codes[(row - row % stride) * columns + column - column % stride];
            }
            stride /= 2;
            candidates = grid(stride).collect();
            continue;
        }
        for (batch, cells) in candidates.chunks(sweep.chunk_size() as usize).enumerate() {
            let Some(results) = results(sweep, store, &format!("{ROUNDS}/{round}-{batch}"), cells, monitor)? else {
                return Ok(false);
            };
            for (n, code) in cells.iter().zip(results) {
                (codes[*n], computed[*n]) = (code, true);
            }
        }
        round += 1;
        // Only a cell that was computed, or its neighbour, can differ now; on a new grid, any.
        let near = |n: &usize| neighbours(*n, stride).chain([*n]);
        candidates = candidates.iter().flat_map(near).collect();
    }
}

/// The codes of cells: computed, or kept from an earlier run. `None` if the monitor stopped it.
fn results(
    sweep: &Sweep,
    store: &Store,
    key: &str,
    cells: &[usize],
    monitor: &Monitor,
) -> Result<Option<Vec<u8>>, StoreError> {
    if let Ok((_, codes)) = store.read(key) {
        monitor.found.fetch_add(cells.len() as u64, Relaxed);
        return Ok(Some(codes));
    }
    let cells = cells
        .par_iter()
        .map(|n| sweep.counted_cell(&sweep.cell_index(*n as u64), monitor));
    let codes: Option<Vec<u8>> = cells.map(|cell| Some(cell?.code())).collect();
    codes.iter().try_for_each(|codes| store.write(key, codes))?;
    Ok(codes)
}

/// Writes all chunks. False if the monitor stopped it.
fn write(sweep: &Sweep, store: &Store, codes: &[u8], computed: &[bool], monitor: &Monitor) -> Result<bool, StoreError> {
    let cell = |index: &[u64]| {
        let n = (index[0] * sweep.shape[1] + index[1]) as usize;
        let failure = match (codes[n], computed[n]) {
            (FAILED, true) => sweep.cell(index).failure,
            (FAILED, false) => "not computed, as a neighbouring cell failed".into(),
            _ => String::new(),
        };
        let regime = Regime::SIMULATED.get(usize::from(codes[n])).copied();
        let cell = Cell { regime, inferred: !computed[n], failure, ..Cell::default() };
        (!monitor.stopped()).then_some(cell)
    };
    for index in Shard::ALL.chunks(sweep) {
        if !store.fill(&index, cell)? {
            return Ok(false);
        }
    }
    let inferred = computed.iter().map(|computed| u64::from(!computed)).sum();
    monitor.inferred.store(inferred, Relaxed);
    Ok(true)
}
