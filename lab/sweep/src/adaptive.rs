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

/// The cells of an adaptive sweep, row by row.
struct Cells {
    rows: usize,
    columns: usize,
    codes: Vec<u8>,
    computed: Vec<bool>,
    failures: BTreeMap<usize, String>,
}

/// Computes the store of an adaptive sweep. False if the monitor stopped it.
pub(crate) fn run(sweep: &Sweep, store: &Store, stride: usize, monitor: &Monitor) -> Result<bool, StoreError> {
    let [rows, columns] = [sweep.shape[0] as usize, sweep.shape[1] as usize];
    let mut cells = Cells {
        rows,
        columns,
        codes: vec![ABSENT; rows * columns],
        computed: vec![false; rows * columns],
        failures: BTreeMap::new(),
    };
    let mut stride = stride.min((rows.min(columns) / SIDE).max(1).next_power_of_two());
    let mut next = cells.grid(stride);
    let mut round = 0;
    loop {
        while !next.is_empty() {
            for (batch, part) in next.chunks(sweep.chunk_size()).enumerate() {
                if !cells.compute(sweep, store, &format!("{ROUNDS}/{round}-{batch}"), part, monitor)? {
                    return Ok(false);
                }
            }
            round += 1;
            // Only a cell that was computed, or its neighbour, can differ now.
            next = cells.differing(
                next.iter().flat_map(|n| cells.neighbours(*n, stride).chain([*n])),
                stride,
            );
        }
        if stride == 1 {
            return cells.write(sweep, store, monitor);
        }
        cells.infer(stride);
        stride /= 2;
        next = cells.differing(cells.grid(stride), stride);
    }
}

impl Cells {
    /// All cells of the grid with this distance.
    fn grid(&self, stride: usize) -> Vec<usize> {
        let row = |row: usize| {
            (0..self.columns)
                .step_by(stride)
                .map(move |column| row * self.columns + column)
        };
        (0..self.rows).step_by(stride).flat_map(row).collect()
    }

    /// The neighbours of a cell at this distance, up to four.
    fn neighbours(&self, n: usize, stride: usize) -> impl Iterator<Item = usize> + use<> {
        let (columns, row, column) = (self.columns, n / self.columns, n % self.columns);
        let before = [
            (row >= stride).then(|| n - stride * columns),
            (column >= stride).then(|| n - stride),
        ];
        let after = [
            (row + stride < self.rows).then(|| n + stride * columns),
            (column + stride < columns).then(|| n + stride),
        ];
        before.into_iter().chain(after).flatten()
    }

    /// Those of the cells that are not computed and differ from a neighbour, in order.
    fn differing(&self, cells: impl IntoIterator<Item = usize>, stride: usize) -> Vec<usize> {
        let differs = |n: &usize| {
            self.neighbours(*n, stride)
                .any(|other| self.codes[other] != self.codes[*n])
        };
        let mut cells: Vec<usize> = cells.into_iter().filter(|n| !self.computed[*n] && differs(n)).collect();
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    /// New cells of the grid with half this distance take the regime of the cell before them.
    fn infer(&mut self, stride: usize) {
        for n in self.grid(stride / 2) {
            let (row, column) = (n / self.columns, n % self.columns);
            if self.codes[n] == ABSENT {
                self.codes[n] = self.codes[(row - row % stride) * self.columns + column - column % stride];
            }
        }
    }

    /// Computes cells, or reads their results. False if the monitor stopped it.
    fn compute(
        &mut self,
        sweep: &Sweep,
        store: &Store,
        key: &str,
        cells: &[usize],
        monitor: &Monitor,
    ) -> Result<bool, StoreError> {
        type Results = Vec<(usize, u8, String)>;
        let kept: Option<Results> = store
            .kept(key, monitor)
            .and_then(|text| serde_json::from_slice(&text).ok());
        let results = if let Some(results) = kept {
            monitor.found.fetch_add(cells.len() as u64, Relaxed);
            results
        } else {
            let compute = |n: &usize| {
                let index = [(n / self.columns) as u64, (n % self.columns) as u64];
                (!monitor.stop.load(Relaxed)).then(|| {
                    let cell = sweep.cell_at(&index);
                    monitor.note(&cell);
                    (*n, code(&cell), cell.failure)
                })
            };
            let Some(results) = cells.par_iter().map(compute).collect::<Option<Results>>() else {
                return Ok(false);
            };
            store.keep(key, &serde_json::to_vec(&results).unwrap_or_default())?;
            results
        };
        for (n, code, failure) in results {
            self.codes[n] = code;
            self.computed[n] = true;
            if !failure.is_empty() {
                self.failures.insert(n, failure);
            }
        }
        Ok(true)
    }

    /// Writes all chunks.
    fn write(&self, sweep: &Sweep, store: &Store, monitor: &Monitor) -> Result<bool, StoreError> {
        let inferred = || "not computed, as a neighbouring cell failed".to_string();
        let cell = |index: Vec<u64>| {
            let n = index[0] as usize * self.columns + index[1] as usize;
            let failure = self.failures.get(&n).cloned();
            Cell {
                regime: Regime::SIMULATED.get(usize::from(self.codes[n])).copied(),
                inferred: !self.computed[n],
                failure: failure
                    .or_else(|| (self.codes[n] == FAILED).then(inferred))
                    .unwrap_or_default(),
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
        let inferred = self.computed.iter().filter(|computed| !**computed).count();
        monitor.inferred.store(inferred as u64, Relaxed);
        store.tidy()?;
        Ok(true)
    }
}
