//! What the free motion adds, in double-double arithmetic: for a propagator that is used many times.

use crate::arithmetic::{divided, plus, product, split_coefficient, times, two_sum};
use crate::oscillator::{Oscillator, Transition};

/// `1/n!` with its rounding error.
const PER_FACTORIAL: [(f64, f64); 18] = {
    let (mut terms, mut n) = ([(1.0, 0.0); 18], 2);
    while n < terms.len() {
        terms[n] = divided(terms[n - 1], n as f64);
        n += 1;
    }
    terms
};

impl Oscillator {
    /// What the free motion over `t` seconds adds: a Taylor series over a time that is short against every rate, doubled as often as
    /// needed.
    pub(super) fn increment(&self, t: f64) -> FreeIncrement {
        // Terms from `PLAIN` on are so small that rounding them leaves 23 digits; those from `TERMS` on are below that.
        const PLAIN: usize = 7;
        const TERMS: usize = 18;
        let (mut t, mut doublings) = (t, 0);
        while 4.0 * self.fastest * t > 1.0 {
            (t, doublings) = (0.5 * t, doublings + 1);
        }
        let (damping, spring) = self.rates();
        let (damping, spring) = (times(damping, (-t, 0.0)), times(spring, product(-t, t)));
        // Derivatives of the motion that starts with a displacement of 0 and a velocity of 1/t, in units of time of t.
        let (mut d, mut s, mut p) = ([(0.0, 0.0), (1.0, 0.0)], (1.0, 0.0), (0.0, 0.0));
        for n in 2..PLAIN {
            d = [d[1], plus(times(damping, d[1]), times(spring, d[0]))];
            s = plus(s, times(d[1], PER_FACTORIAL[n]));
            p = plus(p, times(d[1], PER_FACTORIAL[n - 1]));
        }
        let (mut d, mut small) = (d.map(|(d, _)| d), (0.0, 0.0));
        for n in PLAIN..TERMS {
            d = [d[1], damping.0 * d[1] + spring.0 * d[0]];
            small = (
                small.0 + PER_FACTORIAL[n].0 * d[1],
                small.1 + PER_FACTORIAL[n - 1].0 * d[1],
            );
        }
        let short = FreeIncrement {
            p: plus(p, (small.1, 0.0)),
            s: times(plus(s, (small.0, 0.0)), (t, 0.0)),
        };
        (0..doublings).fold(short, |one, _| self.composed(&one, &one))
    }

    /// What two times, one after the other, add.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn composed(&self, a: &FreeIncrement, b: &FreeIncrement) -> FreeIncrement {
        let (damping, spring) = self.rates();
        let square = times(a.s, b.s);
        let p = plus(times(a.p, b.p), times((-spring.0, -spring.1), square));
        let s = plus(plus(times(a.p, b.s), times(b.p, a.s)), times(damping, square));
        FreeIncrement { p: plus(plus(a.p, b.p), p), s: plus(plus(a.s, b.s), s) }
    }

    /// What an increment adds to position and velocity, as the sum of two maps: for one that is used many times. A rounded one would be a
    /// steady source or sink of energy, and shift the phase.
    pub(super) fn split(&self, FreeIncrement { p, s }: &FreeIncrement) -> (Transition, Transition) {
        let (damping, spring) = self.rates();
        let entries = [plus(*p, times(damping, *s)), *s, times((-spring.0, -spring.1), *s), *p];
        let [xx, xv, vx, vv] = entries.map(split_coefficient);
        let part = |xx, xv, vx, vv| Transition { xx, xv, vx, vv };
        (part(xx.0, xv.0, vx.0, vv.0), part(xx.1, xv.1, vx.1, vv.1))
    }
}

/// What a transition adds, in double-double arithmetic: `p = vv - 1` and `s = xv`. With them `xx = 1 + p + 2 delta s` and
/// `vx = -omega0² s`.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeIncrement {
    p: (f64, f64),
    s: (f64, f64),
}

/// From its two maps ([`Oscillator::split`]).
impl From<&(Transition, Transition)> for FreeIncrement {
    fn from((head, tail): &(Transition, Transition)) -> Self {
        Self { p: two_sum(head.vv, tail.vv), s: two_sum(head.xv, tail.xv) }
    }
}
