//! The first instant a gap closes, with a certificate that it is the first.
//!
//! The search is *conservative advancement*. Of each gap `g` its value, closing speed, closing acceleration and a bound `J` on the third
//! derivative are known, and Taylor's theorem with Lagrange's remainder gives `g(t+h) >= g - g1 h - g2 h²/2 - J h³/6`. Up to the first root
//! of the right-hand side no contact is possible, so a march by such steps can never jump over one, however long the steps or shallow the
//! graze; and as the right-hand side touches the gap to third order, the march closes in on a contact cubically.
//!
//! Sources: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", PhD thesis, UC Berkeley 1996, chapter 2
//! (conservative advancement); R. E. Moore, "Interval Analysis", Prentice-Hall 1966 (bounding by Taylor's remainder).

use core::ops::Index;

/// What is known of a motion at one instant: by index, position and its first six derivatives; and what its bounds follow from.
pub trait Look: Copy + Index<usize, Output = f64> {}

/// A gap and how it closes now: `g(t+h) = gap - closing h - acceleration h²/2 - jerk h³/6 - ...`
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// The gap; below 0 it is closed, whether or not it opens again.
    pub gap: f64,
    /// Closing speed, `-g'`.
    pub closing: f64,
    /// Closing acceleration, `-g''`.
    pub acceleration: f64,
    /// Closing jerk, `-g'''`.
    pub jerk: f64,
}

/// Bounds of the derivatives of the gaps over a `window` from now, s, given those of the motion now.
pub trait Bounds<D> {
    /// A bound of the third derivative.
    fn third(&self, d: &D, window: f64) -> f64;

    /// A bound of the first derivative. It helps where rounding errors of the higher ones are large.
    fn first(&self, _d: &D, _window: f64) -> f64 {
        f64::INFINITY
    }

    /// How long gap number `_which` is certainly open, s, at most `window`.
    fn open(&self, _which: usize, gap: &Gap, d: &D, window: f64) -> f64 {
        let open = gap.certainly_open(window, |h| self.third(d, h));
        open.max((gap.gap / self.first(d, window)).min(window))
    }
}

/// Where a gap closes: `h` seconds after a look at `t`, close enough for the local Taylor polynomial.
#[derive(Clone, Copy, Debug)]
pub struct Closure<D> {
    /// Time of the last look, s.
    pub t: f64,
    /// From there to the contact, s.
    pub h: f64,
    /// Which gap.
    pub which: usize,
    /// Derivatives of the motion at the last look.
    pub derivatives: D,
}

/// A contact nearer than this fraction of the fastest rate's time is solved on the local Taylor polynomial, whose first
/// term left out is then below 1e-16/24 of the motion's amplitude.
const NEAR_CONTACT: f64 = 1e-4;
/// Steps below [`TINY`] times the fastest rate's time that are tolerated in a row.
const MOST_TINY_STEPS: usize = 20;
const TINY: f64 = 1e-9;
/// Below this a sum of squares has lost digits.
const UNDERFLOW: f64 = 1e-290;
/// Largest number of looks in one search.
const MOST_LOOKS: u64 = 100_000_000;
/// So many windows are tried for a bound, each at most three times shorter than the last.
const MOST_WINDOWS: usize = 40;

/// The first closure of any of `N` gaps in `[from, limit]`, or until when there is none, and how often the motion was evaluated.
///
/// `look` returns the gaps at a time and the derivatives of the motion there; `fastest` is the fastest rate of the motion, 1/s;
/// `resolutions` are the rounding errors of the gaps.
#[cfg_attr(not(target_arch = "wasm32"), inline)]
pub fn first_closure<const N: usize, D: Look>(
    (from, limit): (f64, f64),
    (fastest, resolutions): (f64, [f64; N]),
    look: impl Fn(f64) -> ([Gap; N], D),
    bounds: impl Bounds<D>,
) -> (Result<Closure<D>, f64>, u64) {
    let mut t = from;
    let mut looks = 0;
    let mut tiny_steps = 0;
    while t < limit && looks < MOST_LOOKS {
        looks += 1;
        let (gaps, derivatives) = look(t);
        let left = limit - t;
        let mut step = left;
        let mut nearest: Option<(f64, usize)> = None;
        for (which, gap) in gaps.iter().enumerate() {
            let open = if gap.gap < 0.0 {
                0.0
            } else {
                bounds.open(which, gap, &derivatives, left)
            };
            if open * fastest < NEAR_CONTACT && open < left {
                let contact = gap.contact_nearby(2.0 * NEAR_CONTACT / fastest);
                if let Some(h) = contact.filter(|h| *h <= left)
                    && nearest.is_none_or(|(nearer, _)| h < nearer)
                {
                    nearest = Some((h, which));
                }
            }
            step = step.min(open);
        }
        if let Some((h, which)) = nearest {
            return (Ok(Closure { t, h, which, derivatives }), looks);
        }
        tiny_steps = if step * fastest < TINY { tiny_steps + 1 } else { 0 };
        let mut least = t * f64::EPSILON;
        if tiny_steps > MOST_TINY_STEPS {
            // A gap that has no digits left, and neither closes nor opens, would hold the march for ever: move on by a time
            // in which nothing that can be told happens.
            let blurred = gaps
                .iter()
                .zip(resolutions)
                .enumerate()
                .map(|(which, (gap, resolution))| {
                    let gap = Gap { gap: gap.gap + resolution, ..*gap };
                    bounds.open(which, &gap, &derivatives, left)
                });
            least = blurred.fold(left, f64::min).max(least);
        }
        t += step.max(least);
    }
    (Err(t.min(limit)), looks)
}

impl Gap {
    /// The longest `h <= window` found for which the gap is certainly open on `[0, h)`; `jerk(h)` bounds the third
    /// derivative over `[0, h]`.
    pub fn certainly_open(&self, window: f64, jerk: impl Fn(f64) -> f64) -> f64 {
        let mut safe = 0.0f64;
        // No bound reaches beyond where the gap would close with no jerk at all.
        let mut window =
            first_root(self.gap, self.closing, self.acceleration).map_or(window, |root| window.min(1.5 * root));
        // A shorter window has a smaller remainder: down to the one that the answer itself asks for.
        for _ in 0..MOST_WINDOWS {
            safe = safe.max(self.open_within(window, jerk(window)));
            if safe * 1.5 >= window {
                break;
            }
            window = (safe * 1.5).max(window / 3.0);
        }
        safe
    }

    /// As above for one window: the remainder `J h³/6` is at most `(J window/3) h²/2` there.
    fn open_within(&self, window: f64, jerk: f64) -> f64 {
        let steepest = self.acceleration + jerk * window / 3.0;
        first_root(self.gap, self.closing, steepest).map_or(window, |root| root.min(window))
    }

    /// The contact at most `reach` ahead on the local cubic, if the gap is crossed there.
    fn contact_nearby(&self, reach: f64) -> Option<f64> {
        if self.gap < 0.0 {
            return Some(0.0);
        }
        let mut h = 0.0;
        for _ in 0..4 {
            // The cubic term is a small correction to the acceleration here: a fixed point in two or three rounds.
            let acceleration = self.acceleration + self.jerk * h / 3.0;
            h = first_root(self.gap, self.closing, acceleration)?;
        }
        let approach = self.closing + h * (self.acceleration + h * self.jerk / 2.0);
        (h <= reach && (approach > 0.0 || h == 0.0)).then_some(h)
    }
}

/// The first `h >= 0` at which `gap - closing h - acceleration h²/2` reaches 0 coming from above (`gap >= 0`).
fn first_root(gap: f64, closing: f64, acceleration: f64) -> Option<f64> {
    let discriminant = closing * closing + 2.0 * acceleration * gap;
    let root = if discriminant.abs() < UNDERFLOW && acceleration >= 0.0 {
        // The squares of very small numbers are none, but their root is not.
        libm::hypot(closing, libm::sqrt(2.0 * acceleration) * libm::sqrt(gap))
    } else {
        libm::sqrt(discriminant)
    };
    if closing > 0.0 {
        (root >= 0.0).then(|| 2.0 * gap / (closing + root))
    } else if acceleration > 0.0 {
        Some((root - closing) / acceleration)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_gap_said_to_be_open_is_open(
            gap in 0.0..1.0f64, closing in -2.0..2.0f64, acceleration in -2.0..2.0f64, jerk in 0.0..4.0f64,
        ) {
            let g = Gap { gap, closing, acceleration, jerk };
            let h = g.certainly_open(3.0, |_| jerk);
            for n in 0..200 {
                let t = h * f64::from(n) / 200.0;
                let worst = gap - t * (closing + t * (acceleration / 2.0 + t * jerk / 6.0));
                prop_assert!(worst >= -1e-14, "h {h}, t {t}: {worst}");
            }
        }
    }

    #[test]
    fn an_opening_gap_is_open_for_the_whole_window() {
        let g = Gap { gap: 0.1, closing: -1.0, acceleration: -0.5, jerk: 0.0 };
        assert_eq!(g.certainly_open(0.2, |_| 1.0), 0.2);
    }

    #[test]
    fn a_start_at_rest_on_the_wall_that_draws_away_is_clear_at_once() {
        let g = Gap { gap: 0.0, closing: 0.0, acceleration: -0.5, jerk: 0.0 };
        assert!(g.certainly_open(2.0, |_| 1.0) > 0.5);
    }
}
