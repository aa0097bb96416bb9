//! What is kept between steps. Each entry is used only if its key matches.

use super::coefficients::Coefficients;
use super::flight::FINE;
use super::propagator::Propagator;
use super::short_step::ShortStep;
use crate::base_motion::Drive;
use crate::oscillator::Oscillator;

/// Propagators kept: a motion of so many different flights per period, or flights and parts of them, needs no new ones.
const FLIGHTS: usize = 6;

/// Propagators.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cache {
    /// Of a step that repeats.
    pub step: ShortStep,
    /// Of flights, and of what is left of a step after one.
    flights: [Propagator; FLIGHTS],
    /// Which followed which when they were last used.
    followers: [u8; FLIGHTS],
    last: u8,
    /// Whether the last one was the follower of the one before: only then is the next one predicted.
    regular: bool,
    /// The one to be replaced next.
    oldest: u8,
    /// Of stretches of a march: coarse and fine.
    pub march: [Propagator; 2],
    /// Length of the last whole step without contact, s.
    last_duration: f64,
}

impl Cache {
    /// Whether a whole step without contact can be taken with [`Self::step`]: it is short, and has been taken before.
    #[inline(always)]
    pub fn repeats(&mut self, oscillator: &Oscillator, drive: &Drive, duration: f64) -> bool {
        if duration == self.step.t {
            return true;
        }
        let again = duration == self.last_duration;
        self.last_duration = duration;
        if again && ShortStep::serves(oscillator, drive.omega, duration) {
            self.step = ShortStep::new(oscillator, duration);
        }
        duration == self.step.t
    }

    /// The propagator that followed the last one before, if flights have been regular.
    #[inline(always)]
    pub fn expected(&mut self, oscillator: &Oscillator, coefficients: &Coefficients) -> Option<&Propagator> {
        if !self.regular {
            return None;
        }
        let follower = self.followers[usize::from(self.last)];
        Some(self.ready(oscillator, coefficients, follower))
    }

    /// The expected propagator was the right one.
    #[inline(always)]
    pub fn confirm(&mut self) {
        self.last = self.followers[usize::from(self.last)];
    }

    /// A propagator at a time near `t`: one that is kept, or a new one at `t`.
    #[inline]
    pub fn near(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, t: f64) -> &Propagator {
        let is_near = |n: u8| (self.flights[usize::from(n)].t - t).abs() < coefficients.near;
        let expected = self.followers[usize::from(self.last)];
        self.regular = is_near(expected);
        let n = if self.regular {
            expected
        } else if let Some(n) = (0..FLIGHTS as u8).find(|&n| is_near(n)) {
            n
        } else {
            self.oldest = (self.oldest + 1) % FLIGHTS as u8;
            self.flights[usize::from(self.oldest)] = Propagator::new(oscillator, t, false);
            self.oldest
        };
        let propagator = &mut self.flights[usize::from(n)];
        if self.regular && !propagator.exact {
            *propagator = Propagator::new(oscillator, propagator.t, true);
        }
        self.followers[usize::from(self.last)] = n;
        self.last = n;
        self.ready(oscillator, coefficients, n)
    }

    #[inline(always)]
    fn ready(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, n: u8) -> &Propagator {
        let propagator = &mut self.flights[usize::from(n) % FLIGHTS];
        propagator.prepare(oscillator, coefficients);
        propagator
    }

    /// Makes the march's propagators those of these coefficients.
    #[inline(always)]
    pub fn prepare_march(&mut self, oscillator: &Oscillator, coefficients: &Coefficients) {
        let lengths = [coefficients.stretch, coefficients.stretch / FINE as f64];
        for (propagator, t) in self.march.iter_mut().zip(lengths) {
            if propagator.t != t {
                *propagator = Propagator::new(oscillator, t, true);
            }
            propagator.prepare(oscillator, coefficients);
        }
    }
}

/// The keys of a fast path: everything else is computed from them.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
pub(crate) struct Keys {
    enabled: bool,
    contact_free: f64,
    phasor: (f64, f64),
    rotations: u32,
    step: f64,
    flights: [(f64, bool); FLIGHTS],
    followers: [u8; FLIGHTS],
    last: u8,
    regular: bool,
    oldest: u8,
    last_duration: f64,
}

#[cfg(feature = "serde")]
impl Keys {
    /// The keys of `fast`.
    pub fn of(fast: &super::FastPath) -> Self {
        let cache = &fast.cache;
        Self {
            enabled: fast.enabled,
            contact_free: fast.contact_free,
            phasor: fast.phasor,
            rotations: fast.rotations,
            step: cache.step.t,
            flights: cache.flights.map(|propagator| (propagator.t, propagator.exact)),
            followers: cache.followers,
            last: cache.last,
            regular: cache.regular,
            oldest: cache.oldest,
            last_duration: cache.last_duration,
        }
    }

    /// The fast path of these keys.
    pub fn restore(&self, oscillator: &Oscillator) -> super::FastPath {
        let kept = |t: f64| !t.is_nan();
        let mut fast = super::FastPath {
            enabled: self.enabled,
            contact_free: self.contact_free,
            phasor: self.phasor,
            rotations: self.rotations,
            ..Default::default()
        };
        fast.cache = Cache {
            flights: self.flights.map(|(t, exact)| {
                let kept = kept(t).then(|| Propagator::new(oscillator, t, exact));
                kept.unwrap_or_default()
            }),
            followers: self.followers,
            last: self.last,
            regular: self.regular,
            oldest: self.oldest,
            last_duration: self.last_duration,
            ..Cache::default()
        };
        if kept(self.step) {
            fast.cache.step = ShortStep::new(oscillator, self.step);
        }
        fast
    }
}
