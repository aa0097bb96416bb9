//! Coefficients of the motion at one frequency of the base.

use crate::forcing::Forcing;
use crate::oscillator::Oscillator;

/// Farthest distance of an instant from that of a propagator, in units of the fastest rate's time: Taylor polynomials of degree
/// 5 then leave out less than 1e-17.
pub(super) const NEAR: f64 = 1.0 / 2048.0;
/// Length of a stretch of a march, in the same unit.
const STRETCH: f64 = 1.5;

/// What follows from an oscillator and a frequency.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Coefficients {
    /// The key, rad/s; none before the first use.
    key: Option<f64>,
    pub omega: f64,
    pub forcing: Forcing,
    /// Farthest distance from a propagator's time, s.
    pub near: f64,
    /// Length of a stretch of a march, s.
    pub stretch: f64,
    /// `y^(n)/n!` for n = 2 to 5, per `y`, `y'`, forcing `f` and `f'`, where `y'' + 2 delta y' + omega0² y = f`.
    pub taylor: [[f64; 4]; 4],
}

impl Coefficients {
    /// Makes these the coefficients for `omega`, rad/s, 0 or above.
    #[inline(always)]
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
        let taylor = [2.0, 3.0, 4.0, 5.0].map(|n| {
            factorial *= n;
            let term = now.map(|c: f64| c / factorial);
            forcing = [-omega * omega * forcing[1], forcing[0]];
            let mut next: [f64; 4] = core::array::from_fn(|i| -2.0 * delta * now[i] - omega0_squared * last[i]);
            next[2] += forcing[0];
            next[3] += forcing[1];
            (last, now) = (now, next);
            term
        });
        let rate = fastest.max(omega);
        Self {
            key: Some(omega),
            omega,
            forcing: Forcing::new(oscillator, omega),
            near: NEAR / rate,
            stretch: STRETCH / rate,
            taylor,
        }
    }

    /// Forcing and its rate of change at a phasor, per unit amplitude.
    #[inline(always)]
    pub fn forcing_at(&self, (cos, sin): (f64, f64)) -> (f64, f64) {
        let strength = self.forcing.strength;
        (
            strength.re * sin + strength.im * cos,
            self.omega * (strength.re * cos - strength.im * sin),
        )
    }
}
