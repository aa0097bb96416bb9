//! Random arguments.

use std::ptr::null;

use crate::fuzz::Dice;

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
pub(super) fn numbers(dice: &mut Dice) -> [f64; MOST] {
    std::array::from_fn(|_| match dice.roll(8) {
        0 => dice.pick(&WILD),
        1..=3 => dice.between(-1.0, 1.0),
        4 => dice.between(0.0, 100.0),
        _ => dice.between(0.0, 0.01),
    })
}

/// Mostly one.
pub(super) fn count(dice: &mut Dice) -> usize {
    match dice.roll(16) {
        0 => dice.pick(&[0, usize::MAX, 1 << 40, isize::MAX as usize]),
        1..=11 => 1,
        _ => dice.roll(MOST + 1),
    }
}

/// The pointer, or now and then NULL.
pub(super) fn pointer<T>(dice: &mut Dice, pointer: *const T) -> *const T {
    if dice.one_in(24) { null() } else { pointer }
}
