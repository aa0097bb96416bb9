//! Random numbers and mutations.

/// Number of frames per connection, and the seed.
pub fn size() -> (u64, u64) {
    let number = |name, default| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    (number("FRAMES", 20_000), number("SEED", 1))
}

pub struct Noise(fastrand::Rng);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(fastrand::Rng::with_seed(seed))
    }

    pub fn next(&mut self) -> u64 {
        self.0.u64(..)
    }

    pub fn below(&mut self, end: usize) -> usize {
        self.0.usize(..end.max(1))
    }

    pub fn bytes(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| self.next() as u8).collect()
    }

    /// Bits inverted, bytes exchanged or overwritten, or everything at random; the length stays.
    pub fn mutate(&mut self, bytes: &mut [u8]) {
        let length = bytes.len();
        match self.below(5) {
            0 => (0..=self.below(8)).for_each(|_| bytes[self.below(length)] ^= 1 << self.below(8)),
            1 => bytes.swap(self.below(length), self.below(length)),
            2 => (0..=self.below(8)).for_each(|_| bytes[self.below(length)] = self.next() as u8),
            3 => {
                let (from, to) = (self.below(length), self.below(length));
                bytes[from.min(to)..=from.max(to)].fill(self.next() as u8);
            }
            _ => {
                let random = self.bytes(length);
                bytes.copy_from_slice(&random);
            }
        }
    }
}
