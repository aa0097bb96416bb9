//! Several plants cross their cavities side by side, one in each lane: the loop of [`super::cross`], with masks in place of
//! branches and the same operations in the same order, so that a plant that crosses gets the same bits as alone.

use super::course::TURNS_KEPT;
use super::cross::MOST_GUESSES;
use super::{Contact, MOST_IMPACTS, Plant};
use crate::base_motion::{Phase, turned};
use crate::crossing::{Anchor, Free, Origin, Wave};
use crate::lane::{Lane, Lanes};
use crate::oscillator::Oscillator;
use crate::span::{Span, shorter};
use crate::wall::ImpactLaw;

/// How far one plant has come abreast of the others.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Run {
    /// What is left of its advance.
    pub left: Span,
    /// Impacts on the way.
    pub impacts: u64,
}

/// The plants in their lanes.
struct Row<const N: usize> {
    waves: [Wave<f64>; N],
    oscillators: [Oscillator; N],
    wave: Wave<Lanes<N>>,
    law: ImpactLaw<Lanes<N>>,
    anchor: Anchor<Lanes<N>>,
    state: Origin<Lanes<N>>,
    phase: (Lanes<N>, Lanes<N>),
    left: (Lanes<N>, Lanes<N>),
    /// 1 while a lane is under way, else 0.
    going: Lanes<N>,
    impacts: Lanes<N>,
    dissipated: Lanes<N>,
    velocity: Lanes<N>,
    turns: Lanes<N>,
    guesses: [usize; N],
}

/// Impacts in an advance from which on lining up costs less than it gains.
const WORTH_IT: f64 = 6.0;

impl Plant {
    /// Whether the plant can go abreast of others, and has so many impacts ahead at the speed of its particle that this is a
    /// gain.
    pub(crate) fn gains_abreast(&self, duration: f64) -> bool {
        let way = self.here.particle.abs() * duration;
        way > WORTH_IT * 2.0 * self.parameters.half_width && self.can_go_abreast()
    }

    /// Whether the plant can go abreast of others: it crosses, and nothing is under way that it would do otherwise alone.
    fn can_go_abreast(&self) -> bool {
        let free = self.contact == Contact::Free && self.course.wave().is_some();
        free && match &self.course.landing {
            Some(landing) => landing.fresh,
            // A start on the wall is looked at alone: the particle may be at rest.
            None => !self.course.lags() && self.wall_touched().is_none(),
        }
    }

    /// Crosses abreast for at most `duration` seconds; every plant can go abreast.
    #[inline(always)]
    pub(crate) fn cross_abreast<const N: usize>(
        plants: [&mut Plant; N],
        duration: f64,
    ) -> [Run; N] {
        let plants = plants.map(|plant| {
            if plant.course.stale {
                plant.course.freshen();
            }
            plant
        });
        let mut row = Row::new(&plants, duration);
        while row.pass() {}
        row.leave(plants, duration)
    }
}

impl<const N: usize> Row<N> {
    fn new(plants: &[&mut Plant; N], duration: f64) -> Self {
        let all = |f: fn(&Plant) -> f64| Lanes(core::array::from_fn(|n| f(plants[n])));
        let left: [Span; N] = core::array::from_fn(|n| plants[n].course.lag().plus(duration));
        let waves: [Wave<f64>; N] = core::array::from_fn(|n| plants[n].course.rig);
        Self {
            wave: Wave::abreast(waves.each_ref()),
            waves,
            oscillators: core::array::from_fn(|n| plants[n].alone.oscillator),
            law: ImpactLaw::abreast(core::array::from_fn(|n| &plants[n].law)),
            anchor: Anchor::abreast(core::array::from_fn(|n| &plants[n].course.anchor)),
            state: Origin::abreast(core::array::from_fn(|n| &plants[n].here)),
            phase: (
                all(|plant| plant.base.phase.parts().0),
                all(|plant| plant.base.phase.parts().1),
            ),
            left: (
                Lanes(left.map(|left| left.parts().0)),
                Lanes(left.map(|left| left.parts().1)),
            ),
            going: Lanes([1.0; N]),
            impacts: Lanes([0.0; N]),
            dissipated: all(|plant| plant.tally.dissipated),
            velocity: Lanes([0.0; N]),
            turns: all(|plant| f64::from(plant.course.turns)),
            guesses: [0; N],
        }
    }

    /// One flight and impact in every lane that is under way; false when none is left.
    #[inline(always)]
    fn pass(&mut self) -> bool {
        let (one, zero) = (Lanes::<N>([1.0; N]), Lanes([0.0; N]));
        let start = self.state;
        let free = self.wave.free_motion(&start);
        let crosses = self.wave.certainly_crosses(&start, &free);
        let ahead = Wave::ahead(&start);
        let distance = self.wave.half_width - ahead * start.w;
        // The primary mass is slower than the particle: they close in at less than twice its speed.
        let late = (Lanes::splat(2.0) * start.particle.abs() * (self.left.0 + self.left.1))
            .below(distance);
        let (arrival, near) = self.wave.arrival(&start, &free, &self.anchor);
        let seconds_left = self.left.0 + self.left.1;
        let left = shorter(self.left, (self.anchor.t, arrival.beyond));
        let beyond_end = seconds_left.below(self.anchor.t + arrival.beyond);
        let on_the_way = Lanes::both(
            Lanes::both(zero.below(self.going), crosses),
            Lanes::both(zero.below(seconds_left), Lanes::<N>::not(late)),
        );
        let lands = Lanes::both(on_the_way, Lanes::both(near, Lanes::<N>::not(beyond_end)));

        let velocity = arrival.v - start.particle;
        let after = self.law.rebound(arrival.v, velocity);
        let phase = turned(
            self.phase,
            self.anchor.angle,
            self.wave.omega * arrival.beyond,
        );
        let take = |new: Lanes<N>, old: Lanes<N>| Lanes::choose(lands, new, old);
        self.state = Origin {
            x: take(arrival.x, start.x),
            v: take(after.primary, start.v),
            w: take(ahead * self.wave.half_width, start.w),
            particle: take(after.particle, start.particle),
            turn: (
                take(arrival.turn.0, start.turn.0),
                take(arrival.turn.1, start.turn.1),
            ),
        };
        self.phase = (take(phase.0, self.phase.0), take(phase.1, self.phase.1));
        self.left = (take(left.0, self.left.0), take(left.1, self.left.1));
        self.velocity = take(velocity, self.velocity);
        self.dissipated = take(self.dissipated + after.dissipated, self.dissipated);
        self.impacts = take(self.impacts + one, self.impacts);
        self.turns = take(self.turns + one, self.turns);

        let squared = after.relative * after.relative;
        let rests = Lanes::<N>::not(self.wave.restless.below(squared));
        for lane in 0..N {
            if self.going.0[lane] == 0.0 {
                continue;
            }
            if lands[lane] != 0 {
                self.guesses[lane] = 0;
                if self.turns.0[lane] >= f64::from(TURNS_KEPT) {
                    self.face(lane);
                }
                if rests[lane] != 0 || self.impacts.0[lane] >= MOST_IMPACTS as f64 {
                    self.going.0[lane] = 0.0;
                }
            } else if on_the_way[lane] != 0 && near[lane] == 0 && self.guesses[lane] < MOST_GUESSES
            {
                self.guesses[lane] += 1;
                self.anchor_anew(lane, &free, arrival.beyond.0[lane]);
            } else {
                self.going.0[lane] = 0.0;
            }
        }
        self.going.0.iter().sum::<f64>() > 0.0
    }

    /// Works `e^{i phase}` of a lane out anew.
    #[inline(never)]
    fn face(&mut self, lane: usize) {
        let (sin, cos) =
            libm::sincos(Phase::of_parts((self.phase.0.0[lane], self.phase.1.0[lane])).radians());
        self.state.turn.0.0[lane] = cos;
        self.state.turn.1.0[lane] = sin;
        self.turns.0[lane] = 0.0;
    }

    #[inline(never)]
    fn anchor_anew(&mut self, lane: usize, free: &Free<Lanes<N>>, beyond: f64) {
        let free = Free {
            y: free.y.0[lane],
            dy: free.dy.0[lane],
            speed_squared: free.speed_squared.0[lane],
        };
        let anchor = self.waves[lane].next_anchor(
            &self.oscillators[lane],
            &self.state.of_lane(lane),
            &free,
            (&self.anchor.of_lane(lane), beyond),
        );
        self.anchor.put(lane, &anchor);
    }

    /// Hands the states back to the plants.
    fn leave(&self, plants: [&mut Plant; N], duration: f64) -> [Run; N] {
        let mut lane = 0;
        plants.map(|plant| {
            let n = lane;
            lane += 1;
            let run = Run {
                left: Span::of_parts((self.left.0.0[n], self.left.1.0[n])),
                impacts: self.impacts.0[n] as u64,
            };
            plant.course.anchor = self.anchor.of_lane(n);
            if run.impacts > 0 {
                plant.here = self.state.of_lane(n);
                plant.base.phase = Phase::of_parts((self.phase.0.0[n], self.phase.1.0[n]));
                plant.course.leave();
                plant.course.turns = self.turns.0[n] as u32;
                let tally = &mut plant.tally;
                tally.impacts += run.impacts;
                tally.impact_time = plant.time + Span::of(duration).less(run.left).seconds();
                tally.impact_velocity = self.velocity.0[n];
                tally.dissipated = self.dissipated.0[n];
            }
            run
        })
    }
}
