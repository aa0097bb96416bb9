//! Coefficients of the motion at one frequency of the base.

use crate::forcing::Forcing;
use crate::oscillator::Oscillator;

/// Farthest distance of an instant from that of a propagator, in units of the fastest rate's time: Taylor polynomials of degree
/// 5 then leave out less than 1e-17.
pub(super) const NEAR: f64 = 1.0 / 2048.0;
/// Distance of the points of a grid, in units of the fastest rate's time: Taylor polynomials of degree 9 then leave out less than
/// 1e-18 halfway between two of them.
const SPACING: f64 = 0.0958;
/// Farthest distance of an instant from its point, in distances between points.
const REACH: f64 = 0.7;
/// Points of the grid: its span is a little more than half a period of the fastest rate.
pub(super) const POINTS: usize = 36;
/// Points in a stretch of a march.
pub(super) const STRETCH: usize = 24;
/// Number of Taylor coefficients: of degrees 2 to 9.
pub(super) const TERMS: usize = 8;

/// What follows from an oscillator and a frequency.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Coefficients {
    /// The key, rad/s; none before the first use.
    key: Option<f64>,
    pub omega: f64,
    pub forcing: Forcing,
    /// Farthest distance from a propagator's time, s.
    pub near: f64,
    /// Distance of the points of a grid, and farthest distance of an instant from its point, s.
    pub spacing: f64,
    pub reach: f64,
    /// Length of a stretch of a march, and of the whole grid, s.
    pub stretch: f64,
    pub span: f64,
    /// `y^(n)/n!` for n from 2 on, per `y`, `y'`, forcing `f` and `f'`, where `y'' + 2 delta y' + omega0² y = f`.
    pub taylor: [[f64; TERMS]; 4],
}

impl Coefficients {
    /// Makes these the coefficients for `omega`, rad/s, 0 or above.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn prepare(&mut self, oscillator: &Oscillator, omega: f64) {
        if self.key != Some(omega) {
            *self = Self::new(oscillator, omega);
        }
    }

    #[inline(never)]
    fn new(oscillator: &Oscillator, omega: f64) -> Self {
        let Oscillator { delta, omega0_squared, fastest, .. } = *oscillator;
        // `f'' = -omega² f`: every derivative is a combination of the same four numbers.
        let (mut last, mut now) = ([0.0, 1.0, 0.0, 0.0], [-omega0_squared, -2.0 * delta, 1.0, 0.0]);
        let mut forcing = [1.0, 0.0];
        let mut factorial = 1.0;
        let mut taylor = [[0.0; TERMS]; 4];
        for n in 0..TERMS {
            factorial *= (n + 2) as f64;
            for (terms, c) in taylor.iter_mut().zip(now) {
                terms[n] = c / factorial;
            }
            forcing = [-omega * omega * forcing[1], forcing[0]];
            let mut next: [f64; 4] = core::array::from_fn(|i| -2.0 * delta * now[i] - omega0_squared * last[i]);
            next[2] += forcing[0];
            next[3] += forcing[1];
            (last, now) = (now, next);
        }
        // The grid stays the same while the frequency of the base changes little.
        let rate = if omega <= 1.25 * fastest {
            fastest
        } else {
            1.25 * leading_bits(omega, 2)
        };
        // Multiples of so few bits are exact.
        let spacing = leading_bits(SPACING / rate, 30);
        Self {
            key: Some(omega),
            omega,
            forcing: Forcing::new(oscillator, omega),
            near: NEAR / fastest.max(omega),
            spacing,
            reach: REACH * spacing,
            stretch: spacing * STRETCH as f64,
            span: spacing * POINTS as f64,
            taylor,
        }
    }

    /// Forcing and its rate of change at a phasor, per unit amplitude.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn forcing_at(&self, (cos, sin): (f64, f64)) -> (f64, f64) {
        let strength = self.forcing.strength;
        (
            strength.re * sin + strength.im * cos,
            self.omega * (strength.re * cos - strength.im * sin),
        )
    }
}

/// The first so many bits of a number after its first one.
fn leading_bits(x: f64, bits: u32) -> f64 {
    f64::from_bits(x.to_bits() & (u64::MAX << (52 - bits)))
}
