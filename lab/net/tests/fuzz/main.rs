//! Random and mutated frames on every connection: no panic, and no drive reaches a rig that was not sent.
//!
//! `scripts/stress --network` runs this with 10^7 frames per connection; FRAMES and SEED set both. The suite takes a small part.

mod noise;
mod relay;
mod vines;

use std::env;

/// Number of frames per connection, and the seed.
fn size() -> (u64, u64) {
    let number = |name, default| env::var(name).map_or(default, |text| text.parse().unwrap());
    (number("FRAMES", 20_000), number("SEED", 1))
}
