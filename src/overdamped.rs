//! What a steady push does to an oscillator that is overdamped, from rest.
//!
//! `x'' + 2 delta x' + omega0² x = 1` and `= t`: the integrals of `(e^{slow t} - e^{fast t})/(slow - fast)`, once and twice.
//! With damping far above critical the position at which such a motion comes to rest at last lies far off, and taking it off
//! at the start to add it again later would leave no digits of what happens in between.

use crate::oscillator::{APART, Oscillator, Regime};

/// Whether the rates of `oscillator` are far apart.
pub(crate) fn is_apart(oscillator: &Oscillator) -> bool {
    matches!(oscillator.regime, Regime::Overdamped { half_gap, .. } if half_gap > APART * oscillator.delta)
}

/// Positions after `t` seconds under a push of 1 and under one that grows as the time, s² and s³, where the rates are apart.
pub(crate) fn pushed(oscillator: &Oscillator, t: f64) -> (f64, f64) {
    let Regime::Overdamped { slow, fast, .. } = oscillator.regime else {
        return (0.0, 0.0);
    };
    let (of_slow, of_fast) = (integrals(slow, t), integrals(fast, t));
    let gap = slow - fast;
    ((of_slow.0 - of_fast.0) / gap, (of_slow.1 - of_fast.1) / gap)
}

/// The integral of `e^{rate t}` from 0 to `t`, and the integral of that, for a rate of 0 or below.
fn integrals(rate: f64, t: f64) -> (f64, f64) {
    let z = rate * t;
    if z > -0.5 {
        // `(e^z - 1 - z)/z²`; the first term left out is below 2^-14/16! = 3e-18.
        let mut series = 1.0;
        for n in (3..=15).rev() {
            series = series * z / f64::from(n) + 1.0;
        }
        let twice = 0.5 * series;
        (t * (1.0 + z * twice), t * t * twice)
    } else {
        let once = libm::expm1(z);
        (once / rate, (once - z) / rate / rate)
    }
}

#[cfg(test)]
#[path = "../tests/unit/overdamped.rs"]
mod tests;
