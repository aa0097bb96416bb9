//! The arrival at a wall, found near a propagator's time.

use super::coefficients::{Coefficients, NEAR};
use super::propagator::{Nearby, Propagator};
use super::start::Start;
use super::verify::Sample;
use crate::arithmetic::Sum;
use crate::base_motion::Phase;
use crate::contact::Wall;

/// The state just before a contact.
#[derive(Clone, Copy)]
pub(super) struct Arrival {
    /// Time until then, s.
    pub t: Sum,
    /// Displacement and velocity of the primary mass, m and m/s.
    pub x: Sum,
    pub v: Sum,
    /// Relative velocity, m/s.
    pub dw: f64,
    /// The wall touched.
    pub wall: Wall,
    /// Phase of the base, and `e^{i phase}`.
    pub phase: Phase,
    pub phasor: (f64, f64),
}

/// A contact that was predicted, with the motion just before it.
pub(super) struct Predicted {
    pub arrival: Arrival,
    pub sample: Sample,
}

/// The contact at `wall`, if it is so near the time of `propagator` that its digits can be trusted; else a better guess of
/// its time, s.
///
/// From the propagator's time on the motion is its Taylor polynomial, and the root the polynomial's reversed series (P. Henrici,
/// "Applied and Computational Complex Analysis" I, Wiley 1974, section 1.7).
#[inline(always)]
pub(super) fn arrive(
    coefficients: &Coefficients,
    propagator: &Propagator,
    start: &Start,
    wall: Wall,
) -> Result<Predicted, f64> {
    let amplitude = start.base.drive.amplitude;
    let increment = propagator.increment(amplitude, &start.point);
    let w = start.sample.w + (increment.y + start.drift * propagator.t);
    let slowness = 1.0 / (start.point.dy + increment.dy + start.drift);
    let first = (wall.sign() * start.half_width() - w) * slowness;
    // Not a number where the approach has no speed.
    let close = first.abs() < 256.0 * coefficients.near;
    if !close {
        return Err(propagator.t + first);
    }
    let nearby = Nearby::new(coefficients, amplitude, &start.point, &increment);
    let [c2, c3, c4, _] = nearby.c;
    let (a2, a3, a4) = (c2 * slowness, c3 * slowness, c4 * slowness);
    let (bend, a22, first2) = (a2 * first, a2 * a2, first * first);
    let third = (a22 + a22) - a3;
    let fourth = 5.0 * (a2 * (a3 - a22)) - a4;
    let h = first * ((1.0 - bend) + first2 * (third + first * fourth));
    // Far away, or where the approach is slow and curved, the reversed series is not accurate.
    if !(first.abs() < coefficients.near && bend.abs() < NEAR) {
        return Err(propagator.t + h);
    }
    let at = nearby.at(h);
    let t = Sum::of(propagator.t, h);
    let dw = start.sample.dw + at.dy;
    let masses = start.masses;
    Ok(Predicted {
        sample: Sample {
            w: wall.sign() * start.half_width(),
            dw,
            ddw: 2.0 * c2 + h * (6.0 * c3),
        },
        arrival: Arrival {
            t,
            x: masses.x.plus(at.y + start.base.drive.signal[1] * t.value()),
            v: masses.v.plus(at.dy),
            dw,
            wall,
            phase: (start.base.phase).rotated(propagator.angle, coefficients.omega * h),
            phasor: at.phasor,
        },
    })
}
