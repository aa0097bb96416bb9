//! Random arguments.

use std::ptr::null;

use crate::fuzz::RandomSource;

/// Values that nobody expects.
pub(super) const WILD: [f64; 12] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e9,
    1e300,
    -1e300,
    1e-300,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MIN_POSITIVE,
];
/// Elements of an array.
pub(super) const MOST: usize = 6;

/// Some of them wild.
pub(super) fn numbers(random: &mut RandomSource) -> [f64; MOST] {
    std::array::from_fn(|_| match random.below(8) {
        0 => random.pick(&WILD),
        1..=3 => random.between(-1.0, 1.0),
        4 => random.between(0.0, 100.0),
        _ => random.between(0.0, 0.01),
    })
}

/// Mostly one.
pub(super) fn count(random: &mut RandomSource) -> usize {
    match random.below(16) {
        0 => random.pick(&[0, usize::MAX, 1 << 40, isize::MAX as usize]),
        1..=11 => 1,
        _ => random.below(MOST + 1),
    }
}

/// The pointer, or now and then NULL.
pub(super) fn pointer<T>(random: &mut RandomSource, pointer: *const T) -> *const T {
    if random.one_in(24) { null() } else { pointer }
}
