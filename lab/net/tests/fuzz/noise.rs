//! Random numbers (SplitMix64) and mutations.

/// Number of frames per connection, and the seed.
pub fn size() -> (u64, u64) {
    let number = |name, default| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    (number("FRAMES", 20_000), number("SEED", 1))
}

pub struct Noise(pub u64);

impl Noise {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
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
