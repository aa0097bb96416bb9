//! Where inferred cells are likely to be wrong: the share of wrong ones among those tested near by.

/// Side of the blocks in which tests are counted, cells.
const BLOCK: usize = 8;
/// Weight of the share in the whole map, tests.
const PRIOR: f64 = 4.0;
/// Below this share, cells are not tested.
const SURE: f64 = 5e-4;
/// Share of computed cells above which nothing is tested any more, and up to which borders that tests found are followed.
const LARGEST: f64 = 0.149;
const FOLLOWED: f64 = 0.15;
/// Share of the cells that are tested in a round, and one in so many of a block.
const ROUND: f64 = 0.005;
const ONE_IN: usize = 4;

/// Tests of inferred cells.
pub(crate) struct Doubt {
    rows: usize,
    columns: usize,
    /// Tests, and wrong cells among them, in every block.
    blocks: Vec<[u32; 2]>,
    round: usize,
}

impl Doubt {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        let blocks = vec![[0; 2]; rows.div_ceil(BLOCK) * columns.div_ceil(BLOCK)];
        Self { rows, columns, blocks, round: 0 }
    }

    fn block(&self, n: usize) -> usize {
        n / self.columns / BLOCK * self.columns.div_ceil(BLOCK) + n % self.columns / BLOCK
    }

    /// A cell was tested.
    pub(crate) fn tested(&mut self, n: usize, wrong: bool) {
        let block = self.block(n);
        self.blocks[block][0] += 1;
        self.blocks[block][1] += u32::from(wrong);
    }

    /// Takes every cell of the first grid among four equal neighbours as a test of what would have been inferred there.
    pub(crate) fn expect(&mut self, codes: &[u8], stride: usize) {
        let inside = |size: usize| (stride..size.saturating_sub(stride)).step_by(stride);
        for row in inside(self.rows) {
            for column in inside(self.columns) {
                let n = row * self.columns + column;
                let down = stride * self.columns;
                let around = [n - down, n + down, n - stride, n + stride].map(|one| codes[one]);
                if around.iter().all(|one| *one == around[0]) {
                    self.tested(n, codes[n] != around[0]);
                }
            }
        }
    }

    /// The share of wrong cells that is to be expected in a block, from the tests in it and in the blocks around.
    fn shares(&self) -> Vec<f64> {
        let columns = self.columns.div_ceil(BLOCK);
        let rows = self.rows.div_ceil(BLOCK);
        let share = |tests: u32, wrong: u32, all: f64| (f64::from(wrong) + PRIOR * all) / (f64::from(tests) + PRIOR);
        let sum = |blocks: &mut dyn Iterator<Item = usize>| {
            blocks.fold((0, 0), |(tests, wrong), n| {
                (tests + self.blocks[n][0], wrong + self.blocks[n][1])
            })
        };
        let (tests, wrong) = sum(&mut (0..self.blocks.len()));
        let all = f64::from(wrong) / f64::from(tests.max(1));
        let near = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        (0..self.blocks.len())
            .map(|n| {
                let around = near(n / columns, rows);
                let mut around =
                    around.flat_map(|row| near(n % columns, columns).map(move |column| row * columns + column));
                let (tests, wrong) = sum(&mut around);
                share(tests, wrong, all)
            })
            .collect()
    }

    /// The cells to be tested next, in order: some of each block with the largest shares.
    pub(crate) fn cells(&mut self, computed: &[bool]) -> Vec<usize> {
        let done = computed.iter().filter(|one| **one).count() as f64;
        let all = computed.len() as f64;
        let most = (ROUND * all).ceil().min(LARGEST * all - done);
        self.round += 1;
        let shares = self.shares();
        let mut order: Vec<usize> = (0..shares.len()).filter(|n| shares[*n] > SURE).collect();
        order.sort_by(|one, other| shares[*other].total_cmp(&shares[*one]));
        let mut found = Vec::new();
        for block in order {
            if found.len() as f64 >= most {
                break;
            }
            let free: Vec<usize> = self.inside(block).filter(|n| !computed[*n]).collect();
            // Another part in every round, without a pattern.
            let chosen = |n: &&usize| scattered(**n + 7919 * self.round).is_multiple_of(ONE_IN);
            let part: Vec<usize> = free.iter().filter(chosen).copied().collect();
            found.extend(if part.is_empty() { free } else { part });
        }
        found.truncate(most.max(0.0) as usize);
        found.sort_unstable();
        found
    }

    /// The cells of a block.
    fn inside(&self, block: usize) -> impl Iterator<Item = usize> + use<> {
        let (size, across) = (self.columns, self.columns.div_ceil(BLOCK));
        let (row, column) = (block / across * BLOCK, block % across * BLOCK);
        let rows = row..(row + BLOCK).min(self.rows);
        let columns = column..(column + BLOCK).min(size);
        rows.flat_map(move |row| columns.clone().map(move |column| row * size + column))
    }
}

/// Number of cells that may be computed along borders that tests found.
pub(crate) fn room(computed: &[bool]) -> usize {
    let done = computed.iter().filter(|one| **one).count() as f64;
    (FOLLOWED * computed.len() as f64 - done).max(0.0) as usize
}

/// A number in which all bits depend on those of `n` (the finaliser of SplitMix64).
fn scattered(n: usize) -> usize {
    let mut x = (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 32) as usize
}
