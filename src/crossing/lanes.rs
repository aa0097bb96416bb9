//! Several flights abreast, and one of them again.

use super::{Anchor, Origin, Wave};
use crate::lane::Lanes;
use crate::oscillator::Transition;
use core::array::from_fn;

impl<const N: usize> Wave<Lanes<N>> {
    /// Several waves abreast.
    pub(crate) fn abreast(waves: [&Wave<f64>; N]) -> Self {
        let all = |f: fn(&Wave<f64>) -> f64| Lanes(waves.map(f));
        Self {
            half_width: all(|wave| wave.half_width),
            delta: all(|wave| wave.delta),
            omega0: all(|wave| wave.omega0),
            fastest: all(|wave| wave.fastest),
            nearest: all(|wave| wave.nearest),
            omega0_squared: all(|wave| wave.omega0_squared),
            omega: all(|wave| wave.omega),
            steady: (all(|wave| wave.steady.0), all(|wave| wave.steady.1)),
            reach: all(|wave| wave.reach),
            speed: all(|wave| wave.speed),
            offset: all(|wave| wave.offset),
            widest: all(|wave| wave.widest),
            near: all(|wave| wave.near),
            restless: all(|wave| wave.restless),
            free: from_fn(|n| {
                (
                    Lanes(waves.map(|wave| wave.free[n].0)),
                    Lanes(waves.map(|wave| wave.free[n].1)),
                )
            }),
            forced: from_fn(|n| Lanes(waves.map(|wave| wave.forced[n]))),
        }
    }
}

impl<const N: usize> Anchor<Lanes<N>> {
    /// Several anchors abreast.
    pub(crate) fn abreast(anchors: [&Anchor<f64>; N]) -> Self {
        let all = |f: fn(&Anchor<f64>) -> f64| Lanes(anchors.map(f));
        Self {
            t: all(|anchor| anchor.t),
            angle: (all(|anchor| anchor.angle.0), all(|anchor| anchor.angle.1)),
            turned: (all(|anchor| anchor.turned.0), all(|anchor| anchor.turned.1)),
            free: (
                Transition::abreast(anchors.map(|anchor| &anchor.free.0)),
                Transition::abreast(anchors.map(|anchor| &anchor.free.1)),
            ),
        }
    }

    /// One of them.
    pub(crate) fn of_lane(&self, lane: usize) -> Anchor<f64> {
        Anchor {
            t: self.t.0[lane],
            angle: (self.angle.0.0[lane], self.angle.1.0[lane]),
            turned: (self.turned.0.0[lane], self.turned.1.0[lane]),
            free: (self.free.0.of_lane(lane), self.free.1.of_lane(lane)),
        }
    }

    /// Replaces one of them.
    pub(crate) fn put(&mut self, lane: usize, anchor: &Anchor<f64>) {
        self.t.0[lane] = anchor.t;
        self.angle.0.0[lane] = anchor.angle.0;
        self.angle.1.0[lane] = anchor.angle.1;
        self.turned.0.0[lane] = anchor.turned.0;
        self.turned.1.0[lane] = anchor.turned.1;
        self.free.0.put(lane, &anchor.free.0);
        self.free.1.put(lane, &anchor.free.1);
    }
}

impl<const N: usize> Origin<Lanes<N>> {
    /// Several states abreast.
    pub(crate) fn abreast(states: [&Origin<f64>; N]) -> Self {
        let all = |f: fn(&Origin<f64>) -> f64| Lanes(states.map(f));
        Self {
            x: all(|state| state.x),
            v: all(|state| state.v),
            w: all(|state| state.w),
            particle: all(|state| state.particle),
            turn: (all(|state| state.turn.0), all(|state| state.turn.1)),
        }
    }

    /// One of them.
    pub(crate) fn of_lane(&self, lane: usize) -> Origin<f64> {
        Origin {
            x: self.x.0[lane],
            v: self.v.0[lane],
            w: self.w.0[lane],
            particle: self.particle.0[lane],
            turn: (self.turn.0.0[lane], self.turn.1.0[lane]),
        }
    }
}
