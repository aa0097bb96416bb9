//! Adaptive refinement: the regime is computed where neighbouring cells differ, and inferred elsewhere.
//!
//! A grid of distant cells comes first. The neighbours of every pair that differs are computed until borders are surrounded by equal
//! cells; then the distance is halved, and a new cell takes the regime of the neighbour before it. In the end inferred cells are tested,
//! most likely wrong first (`doubt`). What is computed next follows from what is known, so that a sweep that was killed reads the results
//! of its rounds again and goes on.

use std::{collections::BTreeMap, sync::atomic::Ordering::Relaxed};

use rayon::prelude::*;
use vines_model::regime::Regime;

use crate::{
    cell::Cell,
    doubt::Doubt,
    error::StoreError,
    monitor::Monitor,
    plan::Plan,
    store::{ROUNDS, Store},
    variables::{ABSENT, FAILED, code},
};

/// Reason of an inferred cell whose neighbour failed.
const INFERRED: &str = "not computed, as a cell beside it failed";

/// Least number of cells of the first grid along a side, roughly.
const SIDE: usize = 4;

/// What is known of all cells.
struct Map {
    rows: usize,
    columns: usize,
    codes: Vec<u8>,
    computed: Vec<bool>,
    failures: BTreeMap<usize, String>,
}

/// Computes the store of an adaptive sweep. False if the monitor stopped it.
pub(crate) fn run(plan: &Plan, store: &Store, stride: usize, monitor: &Monitor) -> Result<bool, StoreError> {
    let [rows, columns] = [plan.shape[0] as usize, plan.shape[1] as usize];
    let mut map = Map {
        rows,
        columns,
        codes: vec![ABSENT; rows * columns],
        computed: vec![false; rows * columns],
        failures: BTreeMap::new(),
    };
    // A small map needs a few cells of the first grid along either side.
    let mut stride = stride.min((rows.min(columns) / SIDE).max(1).next_power_of_two());
    let mut round = 0;
    let mut next = map.grid(stride);
    let mut doubt = Doubt::new(rows, columns);
    loop {
        while !next.is_empty() {
            if !map.compute(plan, store, &mut round, &next, monitor)? {
                return Ok(false);
            }
            if round == 1 {
                doubt.expect(&map.codes, stride);
            }
            // Only a cell that was computed, or one beside it, can differ now.
            let near: Vec<usize> = next.iter().flat_map(|n| map.beside(*n, stride).chain([*n])).collect();
            next = map.differing(near, stride);
        }
        if stride == 1 {
            break;
        }
        stride /= 2;
        map.infer(stride);
        next = map.differing(map.grid(stride), stride);
    }
    loop {
        let tests = doubt.cells(&map.codes, &map.computed);
        if tests.is_empty() {
            break;
        }
        let (cells, inferred): (Vec<usize>, Vec<u8>) = tests.iter().map(|one| (one.cell, map.codes[one.cell])).unzip();
        if !map.compute(plan, store, &mut round, &cells, monitor)? {
            return Ok(false);
        }
        for (one, inferred) in tests.into_iter().zip(inferred) {
            doubt.tested(one, map.codes[one.cell] != inferred);
        }
    }
    map.write(plan, store, monitor)
}

/// The eight neighbours of a cell at this distance.
pub(crate) fn beside(n: usize, [rows, columns]: [usize; 2], stride: usize) -> impl Iterator<Item = usize> {
    let around = move |at: usize, size: usize| {
        [at.checked_sub(stride), Some(at), Some(at + stride)]
            .into_iter()
            .flatten()
            .filter(move |one| *one < size)
    };
    around(n / columns, rows)
        .flat_map(move |row| around(n % columns, columns).map(move |column| row * columns + column))
        .filter(move |other| *other != n)
}

impl Map {
    /// All cells of the grid with this distance.
    fn grid(&self, stride: usize) -> Vec<usize> {
        let rows = (0..self.rows).step_by(stride);
        rows.flat_map(|row| {
            (0..self.columns)
                .step_by(stride)
                .map(move |column| row * self.columns + column)
        })
        .collect()
    }

    /// The four neighbours of a cell at this distance.
    fn beside(&self, n: usize, stride: usize) -> impl Iterator<Item = usize> + use<> {
        let columns = self.columns;
        beside(n, [self.rows, columns], stride)
            .filter(move |other| other / columns == n / columns || (other % columns == n % columns))
    }

    /// Those of the cells that are not computed and differ from a neighbour, in order.
    fn differing(&self, mut cells: Vec<usize>, stride: usize) -> Vec<usize> {
        cells
            .retain(|n| !self.computed[*n] && self.beside(*n, stride).any(|other| self.codes[other] != self.codes[*n]));
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    /// New cells of the grid with this distance have the regime of the neighbour before them.
    fn infer(&mut self, stride: usize) {
        for n in self.grid(stride) {
            let (row, column) = (n / self.columns, n % self.columns);
            if self.codes[n] == ABSENT {
                self.codes[n] = self.codes[(row - row % (2 * stride)) * self.columns + column - column % (2 * stride)];
            }
        }
    }

    /// Computes the cells of a round, or reads their results. False if the monitor stopped it.
    fn compute(
        &mut self,
        plan: &Plan,
        store: &Store,
        round: &mut usize,
        cells: &[usize],
        monitor: &Monitor,
    ) -> Result<bool, StoreError> {
        for (batch, cells) in cells.chunks(plan.chunk_size()).enumerate() {
            if !self.compute_batch(plan, store, &format!("{ROUNDS}/{round}-{batch}"), cells, monitor)? {
                return Ok(false);
            }
        }
        *round += 1;
        Ok(true)
    }

    fn compute_batch(
        &mut self,
        plan: &Plan,
        store: &Store,
        key: &str,
        cells: &[usize],
        monitor: &Monitor,
    ) -> Result<bool, StoreError> {
        let kept = store
            .kept(key, monitor)
            .and_then(|text| serde_json::from_slice::<Vec<(usize, u8, String)>>(&text).ok());
        // Another rule may have chosen other cells.
        let same = |results: &Vec<(usize, u8, String)>| results.iter().map(|one| &one.0).eq(cells);
        let results = match kept.filter(same) {
            Some(results) => {
                monitor.found.fetch_add(cells.len() as u64, Relaxed);
                results
            }
            None => {
                let one = |n: &usize| {
                    let index = [(n / self.columns) as u64, (n % self.columns) as u64];
                    (!monitor.stop.load(Relaxed)).then(|| {
                        let cell = plan.cell_at(&index);
                        monitor.note(&cell);
                        (*n, code(&cell), cell.failure)
                    })
                };
                let Some(results) = cells.par_iter().map(one).collect::<Option<Vec<_>>>() else {
                    return Ok(false);
                };
                store.keep(key, &serde_json::to_vec(&results).unwrap_or_default())?;
                results
            }
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

    /// Writes all chunks, also those that are there: another rule may have written them.
    fn write(&self, plan: &Plan, store: &Store, monitor: &Monitor) -> Result<bool, StoreError> {
        let cell = |index: Vec<u64>| {
            let n = index[0] as usize * self.columns + index[1] as usize;
            let failed = || (self.codes[n] == FAILED).then(|| INFERRED.to_string());
            Cell {
                regime: Regime::SIMULATED.get(usize::from(self.codes[n])).copied(),
                inferred: !self.computed[n],
                failure: self.failures.get(&n).cloned().or_else(failed).unwrap_or_default(),
                ..Cell::default()
            }
        };
        for index in (0..plan.chunks()).map(|n| plan.chunk_index(n)) {
            if monitor.stop.load(Relaxed) {
                return Ok(false);
            }
            let cells: Vec<Cell> = (0..plan.chunk_size() as u64)
                .map(|n| plan.cell_index(&index, n).map_or_else(Cell::default, cell))
                .collect();
            store.write(&index, &cells)?;
        }
        let inferred = self.computed.iter().filter(|computed| !**computed).count();
        monitor.inferred.store(inferred as u64, Relaxed);
        store.tidy()?;
        Ok(true)
    }
}
