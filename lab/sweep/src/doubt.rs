//! Where inferred cells are likely to be wrong: the share of wrong ones among those tested near by, times a factor that depends on how many
//! computed neighbours differ. The map's own tests give both.

use rayon::prelude::*;

use crate::adaptive::beside;

/// Side of the blocks in which tests are counted, cells; distances up to which blocks count as near and as far, blocks.
const BLOCK: usize = 4;
const NEAR: usize = 2;
const FAR: usize = 8;
/// Weights of the share in the whole map, and of that of the far blocks, tests.
const PRIOR: [f64; 2] = [4.0, 1.0];
/// Below this share, cells are not tested.
const SURE: f64 = 5e-4;
/// Share of computed cells above which nothing is tested any more, and share of the cells that is tested in a round.
const LARGEST: f64 = 0.15;
const ROUND: f64 = 0.001;
/// Factors expected at first, for no to four and more computed neighbours that differ.
const FACTORS: [f64; 5] = [0.5, 1.5, 3.0, 4.0, 5.0];

/// Number of tests, and of wrong cells among them.
type Tests = [u32; 2];

/// A cell to be tested, with the share of wrong ones near by and the number of its neighbours that differ.
#[derive(Clone, Copy)]
pub(crate) struct Doubtful {
    pub cell: usize,
    share: f64,
    differing: usize,
}

/// Tests of inferred cells.
pub(crate) struct Doubt {
    columns: usize,
    /// Number of blocks along either side.
    blocks: [usize; 2],
    tests: Vec<Tests>,
    /// By the number of neighbours that differ: wrong cells that the shares near by let expect, and wrong cells found.
    found: [[f64; 2]; FACTORS.len()],
}

impl Doubt {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        let blocks = [rows, columns].map(|size| size.div_ceil(BLOCK));
        Self {
            columns,
            blocks,
            tests: vec![[0; 2]; blocks[0] * blocks[1]],
            found: FACTORS.map(|factor| [0.5, 0.5 * factor]),
        }
    }

    fn block(&self, cell: usize) -> usize {
        cell / self.columns / BLOCK * self.blocks[1] + cell % self.columns / BLOCK
    }

    /// A cell was tested.
    pub(crate) fn tested(&mut self, one: Doubtful, wrong: bool) {
        self.count(one.cell, wrong);
        let [expected, found] = &mut self.found[one.differing];
        *expected += one.share;
        *found += f64::from(u8::from(wrong));
    }

    fn count(&mut self, cell: usize, wrong: bool) {
        let block = self.block(cell);
        self.tests[block][0] += 1;
        self.tests[block][1] += u32::from(wrong);
    }

    /// Takes every cell of the first grid among four equal neighbours as a test of what would have been inferred there.
    pub(crate) fn expect(&mut self, codes: &[u8], stride: usize) {
        let inside = |size: usize| (stride..size.saturating_sub(stride)).step_by(stride);
        for row in inside(codes.len() / self.columns) {
            for column in inside(self.columns) {
                let n = row * self.columns + column;
                let down = stride * self.columns;
                let around = [n - down, n + down, n - stride, n + stride].map(|one| codes[one]);
                if around.iter().all(|one| *one == around[0]) {
                    self.count(n, codes[n] != around[0]);
                }
            }
        }
    }

    /// The share of wrong cells that the tests near a block let expect.
    fn shares(&self) -> Vec<f64> {
        let mix = |[tests, wrong]: Tests, share: f64, weight: f64| {
            (f64::from(wrong) + weight * share) / (f64::from(tests) + weight)
        };
        let sums = Sums::new(&self.tests, self.blocks);
        let [tests, wrong] = sums.within(0, usize::MAX);
        let all = f64::from(wrong) / f64::from(tests.max(1));
        (0..self.tests.len())
            .map(|block| {
                mix(
                    sums.within(block, NEAR),
                    mix(sums.within(block, FAR), all, PRIOR[0]),
                    PRIOR[1],
                )
            })
            .collect()
    }

    /// The cells to be tested next, in order: those that are wrong most likely.
    pub(crate) fn cells(&self, codes: &[u8], computed: &[bool]) -> Vec<Doubtful> {
        let done = computed.par_iter().filter(|one| **one).count() as f64;
        let all = computed.len() as f64;
        let most = (ROUND * all).ceil().min(LARGEST * all - done).max(0.0) as usize;
        let shares = self.shares();
        let factors = self.found.map(|[expected, found]| found / expected);
        let doubt = |one: &Doubtful| one.share * factors[one.differing];
        let one = |cell: usize| {
            let differs = |other: &usize| computed[*other] && codes[*other] != codes[cell];
            let around = beside(cell, [codes.len() / self.columns, self.columns], 1);
            let differing = around.filter(differs).count().min(FACTORS.len() - 1);
            Doubtful { cell, share: shares[self.block(cell)], differing }
        };
        let mut found: Vec<Doubtful> = (0..codes.len())
            .into_par_iter()
            .filter(|cell| !computed[*cell])
            .map(one)
            .filter(|one| doubt(one) > SURE)
            .collect();
        if found.len() > most {
            // Without a pattern where the doubt is the same.
            let scattered = |one: &Doubtful| (scattered(one.cell), one.cell);
            found.select_nth_unstable_by(most, |one, other| {
                let doubts = doubt(other).total_cmp(&doubt(one));
                doubts.then_with(|| scattered(one).cmp(&scattered(other)))
            });
            found.truncate(most);
        }
        found.sort_unstable_by_key(|one| one.cell);
        found
    }
}

/// Sums over rectangles of blocks.
struct Sums {
    size: [usize; 2],
    /// Sums of all blocks above and to the left.
    sums: Vec<Tests>,
}

impl Sums {
    fn new(tests: &[Tests], size: [usize; 2]) -> Self {
        let across = size[1] + 1;
        let mut sums = vec![[0; 2]; (size[0] + 1) * across];
        for row in 0..size[0] {
            let mut line = [0; 2];
            for column in 0..size[1] {
                for part in 0..2 {
                    line[part] += tests[row * size[1] + column][part];
                    sums[(row + 1) * across + column + 1][part] = sums[row * across + column + 1][part] + line[part];
                }
            }
        }
        Self { size, sums }
    }

    /// The sum over the blocks up to this distance from one.
    fn within(&self, block: usize, distance: usize) -> Tests {
        let [rows, columns] = [
            [block / self.size[1], self.size[0]],
            [block % self.size[1], self.size[1]],
        ]
        .map(|[at, size]| {
            [
                at.saturating_sub(distance),
                at.saturating_add(distance).saturating_add(1).min(size),
            ]
        });
        let at = |row: usize, column: usize, part: usize| self.sums[row * (self.size[1] + 1) + column][part];
        std::array::from_fn(|part| {
            at(rows[1], columns[1], part) + at(rows[0], columns[0], part)
                - at(rows[0], columns[1], part)
                - at(rows[1], columns[0], part)
        })
    }
}

/// A number in which all bits depend on those of `n` (the finaliser of SplitMix64).
fn scattered(n: usize) -> u64 {
    let mut x = (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
