//! The way to a lock at the requested drive, from rest or with a moving particle.
//!
//! While the response A is controlled, the drive `E_R(A)` that holds it is single-valued. The script moves the setpoint of the response in
//! legs. The one fit ([`ResonanceFit`]) gives `E_R` for each leg, and the frequency.
//!
//! 1. The loop closes under the requested drive.
//! 2. The response rises until drive and frequency are out of reach of a particle that touches no wall: impacts have begun.
//! 3. It falls in small steps until the motion is symmetric 1:1.
//! 4. It goes on, up or down, to where `E_R` is the requested drive, by interpolation of the last three legs. There a constant drive takes
//!    over if `E_R` rises with the amplitude, the condition of stability under a constant drive. Otherwise the response stays under
//!    control.
//!
//! A motion that is symmetric from the start skips steps 2 and 3. A motion that is lost is searched again, more slowly.

use std::f64::consts::{PI, TAU};

use nalgebra::DVector;
use vines_model::numerics::{Estimate, HarmonicBasis, RANDOM, SIGNIFICANT, mean, range};

use super::{CONFIRMED, ControlLoop, ExperimentError, FOLLOWED, Sample, SearchFound, Stage};
use crate::identification::{ASYMMETRIC, Criterion, Cycle, LONGEST_SETTLING, ResonanceFit, degrees, without_tones};
use crate::rig::{Controller, ControllerError, LoopState, Move, Rig};
use vines_scene::knowledge::Target;
use vines_scene::linear::LinearResponse;
use vines_scene::linear::{Impacts, impacts_by_resonance};
use vines_scene::plan::Plan;

/// Phase error, rad, below which the control of the response begins: the drive then does 94 % of its largest work.
const CONTROL_PHASE_ERROR: f64 = 0.35;
/// Largest relative change of the response in a leg: the stable orbits above the fold span a few percent.
const LEG_CHANGE: f64 = 0.04;
/// Largest share of the drive that changes the response.
const STEERING_SHARE: f64 = 0.3;
/// Duration of a rise of the response by the half-width, periods.
const RISE: f64 = 60.0;
/// Largest relative error of the half-width in the drawing.
const DRAWING: f64 = 0.1;
/// Response over the half-width from which impacts are no longer expected: the particle does not move freely.
const UNREACHED: f64 = 1.5;
/// Smallest response over the half-width of the search: up to r = 0.85, the fold has a larger one.
const LOWEST: f64 = 0.05;
/// Smallest ratio of the response to where the lock was found at which the motion counts as the same; the largest is its inverse. The stable range of
/// the symmetric motion is wider. It is also the smallest ratio of the setpoint to a response that follows it.
const SAME_MOTION: f64 = 0.8;
/// Smallest slope of the holding drive over the response under a constant drive, over their ratio, which is the slope without impacts: with less,
/// an error of 1 % of the drive moves the response by more than 10 %, and the motion takes ten times as long to settle.
const SMALLEST_SLOPE: f64 = 0.1;
/// Relative error of the response, and error of the frequency over the half-power bandwidth E/A, at which the response that the requested drive
/// holds has been found.
const RESPONSE_FOUND: f64 = 1e-4;
/// Relative error of the drive at which a constant drive takes over where the drive rises faster than in proportion to the response: a quarter of
/// what a leg changes.
const CLOSE: f64 = 0.25 * LEG_CHANGE;
/// Share of a straight line that is followed where its bend is not known.
const CAUTIOUS: f64 = 0.5;
/// Largest number of levels that are held for it.
const LEGS: usize = 20;
/// Number of searches, each twice as slow as the one before.
const SEARCHES: u32 = 4;

/// What a leg measured.
#[derive(Debug, Clone, Copy)]
struct Leg {
    /// Response amplitude, m: mean and last.
    response: f64,
    last: f64,
    /// Drive that holds it, m, and its standard uncertainty.
    drive: f64,
    noise: f64,
    /// Frequency, rad/s.
    omega: f64,
    /// Whether frequency and loss need impacts.
    departed: bool,
    symmetric: bool,
    /// Second harmonic over the third, as far as noise does not explain it.
    asymmetry: f64,
    /// Mean square of the second harmonic, m², with noise.
    even: f64,
}

/// The search.
pub(crate) struct Search<'b, 'a, R: Rig + ?Sized, C: ?Sized> {
    bench: &'b mut ControlLoop<'a, R, C>,
    linear: LinearResponse,
    /// Half-width of the cavity, and requested drive, m.
    b: f64,
    requested: f64,
    /// Phase target, and what the channels measure.
    target: Target,
    /// Natural period, s.
    period: f64,
    /// Setpoint of the response, m.
    setpoint: f64,
    /// Smallest and largest drive that held a symmetric motion, m; infinite before the first.
    held: (f64, f64),
    /// Smallest and largest response of the legs, m, whether impacts have begun, and the symmetric leg with the drive nearest to the requested one.
    tried: (f64, f64),
    impacts: bool,
    /// Whether a leg that noise does not explain needs them.
    unexplained: bool,
    nearest: Option<Leg>,
    /// How often the motion was lost or not found, and whether one is to settle now, under a constant drive or not.
    lost: u32,
    unsettled: Option<bool>,
    /// The periods at the level that is to settle.
    cycles: Vec<Cycle>,
}

impl<'b, 'a, R: Rig + ?Sized, C: Controller + ?Sized> Search<'b, 'a, R, C> {
    /// The search on a bench.
    pub fn new(bench: &'b mut ControlLoop<'a, R, C>) -> Self {
        let Plan { knowledge, amplitude, .. } = bench.plan;
        Self {
            linear: knowledge.linear,
            b: knowledge.numbers.b,
            requested: *amplitude,
            target: knowledge.target,
            period: TAU / knowledge.linear.omega0,
            bench,
            setpoint: 0.0,
            held: (f64::INFINITY, 0.0),
            tried: (f64::INFINITY, 0.0),
            impacts: false,
            unexplained: false,
            nearest: None,
            lost: 0,
            unsettled: None,
            cycles: Vec::new(),
        }
    }

    /// Goes to the lock at the requested drive. Returns whether the response is held by control there, or `None` where the controller cannot
    /// control it.
    pub fn lock(&mut self) -> Result<Option<bool>, ExperimentError> {
        self.reach_requested().map_err(|error| match error {
            // What a foreign controller or a filter left open says more.
            ExperimentError::NoLock { unmet: None, .. } if self.tried.0 < self.tried.1 => self.not_reached(),
            error => error,
        })
    }

    fn reach_requested(&mut self) -> Result<Option<bool>, ExperimentError> {
        let mut leg = match self.begin() {
            Err(ExperimentError::Controller(ControllerError::NoResponseLoop(_))) => return Ok(None),
            leg => leg?,
        };
        if self.takes_no_moves() {
            self.bench.hold_drive()?;
            return Ok(None);
        }
        for search in 0..SEARCHES {
            let step = LEG_CHANGE / f64::from(1 << search);
            leg = self.symmetric(leg, step)?;
            if let Some(held) = self.solve(&mut leg, step, search >= SEARCHES / 2)? {
                return Ok(Some(held));
            }
            self.lost += 1;
        }
        Err(self.not_reached())
    }

    /// Whether the controller kept its drive, to the last bit, while it was to control the response: one elsewhere may ignore what it does not know.
    fn takes_no_moves(&self) -> bool {
        let count = (FOLLOWED as f64 * self.period / self.bench.sample_time) as usize;
        let last = self.bench.samples.iter().rev().take(count);
        let mut amplitudes = last.map(|sample| sample.command.drive.amplitude);
        let first = amplitudes.next();
        amplitudes.all(|amplitude| Some(amplitude) == first)
    }

    /// Goes to a symmetric motion with impacts, if there is one, and holds its response.
    pub fn impacts(&mut self) -> Result<(), ExperimentError> {
        let leg = self.begin()?;
        self.symmetric(leg, LEG_CHANGE)?;
        Ok(())
    }

    /// Closes the loop and begins to control the response.
    fn begin(&mut self) -> Result<Leg, ExperimentError> {
        let mut near = 0;
        while near < CONFIRMED {
            let period = self.bench.period(Stage::Locking)?;
            let state = self.bench.last.state;
            let closed = state.is_none_or(|state| matches!(state, LoopState::Acquiring | LoopState::Locked));
            let is_near = self.bench.cycle(period, self.target).is_some_and(|cycle| {
                self.setpoint = cycle.amplitude();
                cycle.phase_error.abs() < CONTROL_PHASE_ERROR
            });
            near = if closed && is_near { near + 1 } else { 0 };
        }
        self.leg(0.0, FOLLOWED, 0.0)
    }

    /// Goes to a symmetric motion with impacts: raises the response until they have begun, and lowers it until the motion is symmetric.
    fn symmetric(&mut self, mut leg: Leg, step: f64) -> Result<Leg, ExperimentError> {
        let largest = self.bench.config.amplitude_max.unwrap_or(f64::INFINITY);
        // A drive that does not reach the walls from the middle still moves the structure to a particle that moves.
        let end = (UNREACHED * self.b).min(largest / (self.damping() * (1.0 + DRAWING)));
        let highest = self.b.min(end / (1.0 + DRAWING));
        let spare = STEERING_SHARE * self.gain() * (largest - self.damping() * (1.0 + DRAWING) * highest);
        let rate = (self.b / (RISE * self.period)).min(spare);
        while !leg.departed || leg.response < (1.0 - DRAWING) * highest {
            if leg.symmetric {
                // A rise may resemble impacts; at rest the setpoint tells them apart.
                leg = self.leg(0.0, FOLLOWED, 0.0)?;
                if leg.symmetric {
                    return Ok(leg);
                }
            }
            let change = rate * FOLLOWED as f64 * self.period;
            if leg.last + change > end {
                break;
            }
            leg = self.leg(leg.last + change - self.setpoint, FOLLOWED, rate)?;
        }
        if highest < self.b && !leg.departed {
            return Ok(leg);
        }
        self.fall(leg, step)
    }

    /// Lowers the response as long as it follows, until the motion is symmetric, but not below [`LOWEST`], nor on after impacts have ended, of which even
    /// harmonics are a sign as well. A large response can hide them: beside a carried particle, their evidence grows as the response falls.
    fn fall(&mut self, mut leg: Leg, step: f64) -> Result<Leg, ExperimentError> {
        let mut seen = leg.departed;
        while !leg.symmetric
            && (leg.departed || leg.asymmetry > 0.0 || !seen)
            && self.setpoint > (LOWEST * self.b).max(SAME_MOTION * leg.last)
        {
            leg = self.sweep(&leg, -step * leg.last)?;
            seen |= leg.departed;
        }
        Ok(leg)
    }

    /// Follows the symmetric motion to the response that the requested drive holds. Returns whether it stays under control there; `None` if
    /// the motion is lost. `any`: also one that a constant drive does not hold.
    fn solve(&mut self, leg: &mut Leg, step: f64, any: bool) -> Result<Option<bool>, ExperimentError> {
        let (mut swept, mut upwards) = (vec![*leg], leg.drive < self.requested);
        while leg.symmetric && self.setpoint > LOWEST * self.b {
            let change = step / self.steepness(&swept).max(1.0) * leg.last;
            *leg = self.sweep(leg, if upwards { change } else { -change })?;
            if !leg.symmetric {
                // A change may disturb the symmetry for a while.
                *leg = self.leg(0.0, FOLLOWED, 0.0)?;
            }
            if leg.symmetric {
                swept.push(*leg);
                let Some(levels) = passed(&swept, self.requested, any) else {
                    continue;
                };
                if let Some(held) = self.refine(leg, levels, any, upwards)? {
                    return Ok(Some(held));
                }
                if leg.symmetric {
                    swept = vec![*leg];
                    continue;
                }
            }
            // Above the symmetric motion is one without symmetry, which may go on far below.
            *leg = self.fall(*leg, step)?;
            (swept, upwards) = (vec![*leg], false);
        }
        Ok(None)
    }

    /// Largest relative change of the drive, or of the frequency over the half-power bandwidth E/A, over that of the response, between the last
    /// two legs.
    fn steepness(&self, swept: &[Leg]) -> f64 {
        let [.., two, last] = swept else { return 0.0 };
        let turned = (last.omega - two.omega) / self.linear.omega0 * last.response;
        (last.drive - two.drive).abs().max(turned.abs()) / last.drive / (last.response / two.response - 1.0).abs()
    }

    /// Holds the response at levels until the requested drive holds it there. Returns whether it stays under control; `None` if there is no such
    /// level; the response is then where the sweep goes on, up or down. `first`: the first levels, m, from the highest on, the slope of the drive over
    /// the response there, and the share of a straight line that is followed.
    fn refine(
        &mut self,
        leg: &mut Leg,
        (first, slope, share): (Vec<f64>, f64, f64),
        any: bool,
        upwards: bool,
    ) -> Result<Option<bool>, ExperimentError> {
        let mut levels = Levels {
            legs: Vec::new(),
            slope,
            share,
            by_noise: self.behind_shaker(),
        };
        let end = if upwards { first[0] } else { first[first.len() - 1] };
        let mut first = first.into_iter();
        let (mut next, mut settled) = (first.next(), 0);
        while let Some(to) = next.filter(|_| levels.legs.len().max(settled) < LEGS) {
            *leg = self.level(leg, to)?;
            settled += usize::from(self.behind_shaker());
            if !leg.symmetric {
                return Ok(None);
            }
            // Such a level has settled, and as far as noise explains what is left, no other one is nearer.
            if self.behind_shaker() && (leg.drive - self.requested).abs() < RANDOM * leg.noise {
                return Ok(Some(true));
            }
            levels.add(*leg);
            next = first.next();
            if next.is_some() {
                continue;
            }
            let Some(predicted) = levels.predict(self.requested, any) else {
                break;
            };
            // Behind a shaker a constant command is no constant force: the response stays under control.
            if self.behind_shaker() {
                next = Some(predicted.response);
                continue;
            }
            let by_drive = predicted.is_root && !self.target.through_shaker;
            // A motion that follows the drive faster than in proportion settles by itself.
            let is_steep = by_drive && predicted.slope * leg.response > leg.drive;
            let is_close = is_steep && (leg.drive - self.requested).abs() < CLOSE * leg.drive;
            if !(is_close || self.is_found(leg, &predicted)) {
                next = Some(predicted.response).filter(|to| predicted.is_root || levels.is_new(*to));
                continue;
            }
            // The condition of stability under a constant drive.
            let is_stable = by_drive && predicted.slope > SMALLEST_SLOPE * leg.drive / leg.response;
            if is_stable {
                self.bench.hold_drive()?;
            }
            self.unsettled = Some(is_stable);
            if !self.settle(leg)? {
                self.unsettled = None;
                return Ok(None);
            }
            self.unsettled = None;
            if is_stable || self.is_found(leg, &predicted) {
                return Ok(Some(!is_stable));
            }
            levels
                .legs
                .retain(|level| (level.response - leg.response).abs() > RESPONSE_FOUND * leg.response);
            next = Some(leg.response);
        }
        // The sweep goes on from there.
        *leg = self.level(leg, end)?;
        Ok(None)
    }

    /// Whether a held level is where the requested drive holds the response.
    fn is_found(&self, leg: &Leg, predicted: &Predicted) -> bool {
        let bandwidth = leg.drive / leg.response;
        let change = predicted.response - leg.response;
        let is_near = change.abs() < RESPONSE_FOUND * leg.response
            && (predicted.turning * change).abs() < RESPONSE_FOUND * bandwidth * self.linear.omega0;
        predicted.is_root && is_near || (self.requested - leg.drive).abs() < leg.noise
    }

    /// Holds the response at a level, m, until its drive changes by less than by what it differs from the requested one; behind a shaker, until it has
    /// settled.
    fn level(&mut self, leg: &Leg, to: f64) -> Result<Leg, ExperimentError> {
        let periods = self.periods(to - leg.last, leg) / 2;
        self.leg(to - self.setpoint, periods, 0.0)?;
        let mut before = self.leg(0.0, FOLLOWED, 0.0)?;
        if self.behind_shaker() {
            before.symmetric = self.settle(&mut before)?;
            return Ok(before);
        }
        for _ in 0..LEGS {
            let held = self.leg(0.0, FOLLOWED, 0.0)?;
            // A change may disturb the symmetry for a while.
            let change = (held.drive - before.drive).abs();
            if !held.symmetric || change <= held.noise.max((held.drive - self.requested).abs()) {
                return Ok(held);
            }
            before = held;
        }
        Ok(before)
    }

    /// Waits until the lock has settled. Returns whether it has; if not, the motion has lost its symmetry.
    fn settle(&mut self, leg: &mut Leg) -> Result<bool, ExperimentError> {
        let (mut asymmetric, mut grown, first) = (0, 0, leg.response);
        let mut confirmed = 0;
        self.cycles.clear();
        while asymmetric < 2 {
            let before = leg.even;
            *leg = self.measure(FOLLOWED)?;
            // Beside symmetry breaking the symmetry is lost slowly; noise grows twice in succession in one of six cases.
            grown = if leg.even > before { grown + 1 } else { 0 };
            let settled = match self.behind_shaker() {
                true => self.has_settled(leg, &mut confirmed)?,
                false => self.bench.settled,
            };
            if settled && grown < 2 {
                return Ok(true);
            }
            // Noise may hide an asymmetry, but not where the motion goes.
            let is_there = (SAME_MOTION..1.0 / SAME_MOTION).contains(&(leg.response / first));
            asymmetric = if leg.symmetric && is_there { 0 } else { asymmetric + 1 };
            self.setpoint = leg.last;
        }
        Ok(false)
    }

    /// Whether the response is held behind a shaker. The noise of the readings is then in the command, and through it in the force: the motion moves
    /// by more than the noise of the readings, which is all that controllers and [`Judge`](super::judge::Judge) allow for.
    fn behind_shaker(&self) -> bool {
        self.bench.plan.knowledge.shaker.is_some()
    }

    /// Whether the periods at this level have settled, as a level of the tracked backbone does: drive and frequency are known as precisely as the scene
    /// asks, or, after the longest time, as noise allows. The leg is then what all of them say. `confirmed`: legs in succession that were precise enough.
    fn has_settled(&mut self, leg: &mut Leg, confirmed: &mut u32) -> Result<bool, ExperimentError> {
        let criterion = Criterion {
            knowledge: self.bench.plan.knowledge,
            precision: self.bench.plan.precision,
            largest: leg.response,
            before: [None; 2],
        };
        let Some(estimate) = criterion.best(&self.cycles) else {
            return Ok(false);
        };
        *confirmed = if criterion.is_met(&estimate) { *confirmed + 1 } else { 0 };
        let is_long = self.cycles.len() >= LONGEST_SETTLING;
        if let Some(why) = estimate.unsteady.filter(|_| is_long && *confirmed == 0) {
            let (periods, response) = (self.cycles.len(), self.target.units.response.quantity(leg.response));
            return Err(ExperimentError::NotSteady { periods, response, why });
        }
        let settled = is_long || *confirmed >= CONFIRMED;
        if settled {
            let [drive, omega] = estimate.at;
            *leg = Leg {
                response: estimate.response.value,
                drive: drive.value,
                noise: drive.uncertainty,
                omega: omega.value,
                ..*leg
            };
        }
        Ok(settled)
    }

    /// A leg that changes the response by `change`, m, and lets it go on at this rate.
    fn sweep(&mut self, leg: &Leg, change: f64) -> Result<Leg, ExperimentError> {
        let periods = self.periods(LEG_CHANGE * leg.response, leg);
        self.leg(change, periods, change / (periods as f64 * self.period))
    }

    /// Moves the setpoint by `change`, m, within `periods` and measures meanwhile. The setpoint ends, and goes on, with the growth `onward`, m/s.
    fn leg(&mut self, change: f64, periods: usize, onward: f64) -> Result<Leg, ExperimentError> {
        let to = Move {
            response: (self.setpoint + change).max(LOWEST * self.b),
            duration: periods as f64 * self.period,
            growth: onward,
            ..Move::default()
        };
        self.bench.hold_response(to)?;
        self.setpoint = to.response;
        self.measure(periods)
    }

    /// Periods for a change of the response, m, so that a share of the holding drive makes it.
    fn periods(&self, change: f64, leg: &Leg) -> usize {
        let rate = STEERING_SHARE * self.gain() * leg.drive.max(SMALLEST_SLOPE * self.requested);
        FOLLOWED.max((change.abs() / (rate * self.period)).ceil() as usize)
    }

    /// Growth rate of the response per drive, 1/s, at the natural frequency.
    fn gain(&self) -> f64 {
        0.5 * self.linear.omega0
    }

    /// Drive over the response without impacts, at resonance.
    fn damping(&self) -> f64 {
        self.linear.damping_rate / self.gain()
    }

    /// Measures over `periods`.
    fn measure(&mut self, periods: usize) -> Result<Leg, ExperimentError> {
        let mut begins = Vec::new();
        while begins.len() < periods.max(ResonanceFit::FEWEST) {
            begins.push(self.bench.period(Stage::Locking)?);
        }
        // Two periods tell the harmonics from a drift of the fundamental.
        let from = (begins[0].0 + begins[0].0).saturating_sub(begins[1].0);
        let raw = &self.bench.samples[from..];
        let mean_omega = mean(raw.iter().map(|sample| sample.command.drive.omega));
        let cleaned = without_tones(raw, &self.bench.plan.knowledge, mean_omega);
        let samples = cleaned.as_deref().unwrap_or(raw);
        let ends = begins[1..].iter().map(|next| next.0 - from).chain([samples.len()]);
        let (mut all, mut harmonics) = (Vec::new(), Vec::new());
        for (&(begin, turns), end) in begins.iter().zip(ends) {
            let (begin, step) = (begin - from, self.bench.sample_time);
            let Some(cycle) = Cycle::of(&samples[begin..end], step, turns * TAU, self.target) else {
                continue;
            };
            let two = &samples[(2 * begin).saturating_sub(end)..end];
            harmonics.extend(even_and_odd(two, &self.target, cycle.omega, step));
            all.push(cycle);
        }
        let Some(fit) = ResonanceFit::of(&all, &self.bench.plan.knowledge) else {
            return self.measure(periods);
        };
        if self.behind_shaker() {
            self.cycles.extend_from_slice(&all);
        }
        // Harmonics above the third count as noise of a period, but do not scatter.
        let scatter = fit.excess.min(1.0);
        let certain = |estimate: Estimate| Estimate::new(estimate.value, &[scatter * estimate.uncertainty]);
        let [drive, omega] = fit.at(0.0).map(certain);
        let response = fit.response.value;
        let epsilon = self.bench.plan.knowledge.numbers.epsilon;
        let at = [certain(fit.response), drive, omega];
        let departed = impacts_by_resonance(&self.linear, at, self.target.phase, epsilon) == Impacts::Needed;
        // Noise itself scatters by a share of sqrt(2/n): each window has half of the next one.
        let [even, odd, noise] = [0, 1, 2].map(|k| mean(harmonics.iter().map(|squares: &[f64; 3]| squares[k])));
        let (squares, even, odd) = (even, even - noise, odd - noise);
        let doubtful = SIGNIFICANT * noise / (0.5 * all.len() as f64).sqrt();
        let possible = self.setpoint > LOWEST * self.b && response < UNREACHED * self.b;
        // Without mirror images there is no symmetric motion to tell from others.
        // As displacements.
        let asymmetric = ASYMMETRIC * (2.0_f64 / 3.0).powi(self.target.measurands[0].order());
        let is_even_small =
            !self.bench.plan.knowledge.is_symmetric || even <= (asymmetric * asymmetric * odd).max(doubtful);
        let symmetric = departed && possible && is_even_small;
        let leg = Leg {
            response,
            last: all[all.len() - 1].amplitude(),
            drive: drive.value,
            noise: drive.uncertainty,
            omega: omega.value,
            departed,
            symmetric,
            asymmetry: ((even - doubtful).max(0.0) / odd.max(doubtful)).sqrt(),
            even: squares,
        };
        self.note(&leg, fit.unsteady().is_none());
        Ok(leg)
    }

    /// Notes a leg for the words of a search without a result; one that noise does not explain may resemble impacts.
    fn note(&mut self, leg: &Leg, is_explained: bool) {
        self.tried = range(self.tried, [leg.response]);
        if !is_explained {
            self.unexplained |= leg.departed;
            return;
        }
        self.impacts |= leg.departed;
        if !leg.symmetric {
            return;
        }
        self.held = range(self.held, [leg.drive]);
        let distance = |leg: &Leg| (leg.drive - self.requested).abs();
        if self.nearest.is_none_or(|nearest| distance(leg) < distance(&nearest)) {
            self.nearest = Some(*leg);
        }
    }

    /// The requested drive was not reached.
    fn not_reached(&self) -> ExperimentError {
        let (d, (low, high)) = (self.bench.plan.knowledge.numbers, self.held);
        let is_silent = self
            .bench
            .samples
            .last()
            .is_some_and(|sample| sample.ground_truth.is_none());
        let of = |leg: Leg| [d.excitation(leg.drive), leg.response / d.b, d.sigma(leg.omega)];
        let found = SearchFound {
            tried: [self.tried.0, self.tried.1].map(|response| response / d.b),
            impacts: self.impacts || is_silent && self.unexplained,
            held: self
                .nearest
                .map(|leg| ([low, high].map(|drive| d.excitation(drive)), of(leg))),
            strongest: d.excitation(self.bench.config.amplitude_max.unwrap_or(f64::INFINITY)),
            requested: d.g,
            lost: self.lost,
            unsettled: self.unsettled,
            silent: is_silent.then(|| self.target.units.response.of_metres(d.b)),
        };
        ExperimentError::NotReached { periods: self.bench.periods, found: found.into() }
    }
}

/// Squares of the second and the third harmonic of the response, m², and their mean by noise, for samples `sample_time` seconds apart and a motion of
/// the frequency `omega`, rad/s.
fn even_and_odd(samples: &[Sample], target: &Target, omega: f64, sample_time: f64) -> Option<[f64; 3]> {
    let (count, step) = (samples.len(), omega * sample_time);
    let phases: Vec<f64> = (0..count).map(|n| n as f64 * step).collect();
    // With the squares of these weights, Hann's window, what is not fitted leaks into the harmonics a hundred times less.
    let weights = DVector::from_fn(count, |n, _| (PI * (n as f64 + 0.5) / count as f64).sin());
    let basis = HarmonicBasis::new(&phases, 0, &degrees(target.measurands[0], TAU / step)).weighted(&weights);
    let values = DVector::from_iterator(count, samples.iter().map(|sample| sample.sensors.response));
    let values = values.component_mul(&weights);
    let fit = basis.fit(&values)?;
    let rest = target.noise(basis.residual(&values, &fit).as_slice(), sample_time);
    let [even, odd] = [2, 3].map(|n| fit.harmonic(n).norm_sqr());
    // The weights halve the variance of the residuals, and make that of a harmonic 3/2 of its value without weights: together a factor of 3.
    let coloured = target.colour(2.0 * omega, sample_time);
    Some([even, odd, 3.0 * rest * rest * 4.0 * coloured / count as f64])
}

/// What a sweep has passed: levels of the response, m, near which the requested drive is, or an extremum of the drive that may reach it, the
/// highest first; and the slope of the drive over the response there.
fn passed(swept: &[Leg], requested: f64, any: bool) -> Option<(Vec<f64>, f64, f64)> {
    let beyond = |leg: &Leg| leg.drive - requested;
    let [.., two, last] = swept else { return None };
    let slope = (last.drive - two.drive) / (last.response - two.response);
    let has_passed = |n: f64| beyond(two) * (last.drive - requested + n * (last.drive - two.drive)) <= 0.0;
    let levels = match () {
        // Where the drive rises faster than in proportion, the motion may be lost below.
        () if has_passed(1.0) && slope * last.response > last.drive => vec![last.last],
        () if has_passed(0.0) && (any || slope > 0.0) => vec![last.response - beyond(last) / slope],
        () => {
            let nearest =
                (0..swept.len()).min_by(|n, m| beyond(&swept[*n]).abs().total_cmp(&beyond(&swept[*m]).abs()))?;
            let near = &swept[nearest];
            let is_beyond = |leg: &Leg| {
                let noise = SIGNIFICANT * leg.noise.hypot(near.noise);
                (leg.drive - near.drive).abs() > noise && beyond(leg) / beyond(near) > 1.0
            };
            if !(swept[..nearest].iter().any(is_beyond) && is_beyond(last)) {
                return None;
            }
            let [before, after] = [nearest - 1, nearest + 1].map(|n| swept[n]);
            // Between equal steps, a parabola exceeds its highest sample by an eighth of the difference to a neighbour at most. The response moves
            // meanwhile, so that the whole difference is allowed.
            let steps = [before, after].map(|leg| (leg.drive - near.drive).abs());
            if beyond(near).abs() > steps[0].max(steps[1]) {
                return None;
            }
            let mut levels = vec![before.response, near.response, 0.5 * (near.response + after.response)];
            levels.sort_by(|one, other| other.total_cmp(one));
            levels
        }
    };
    let share = if has_passed(0.0) { 1.0 } else { CAUTIOUS };
    Some((levels, slope, share))
}

/// Held levels by rising response.
#[derive(Debug)]
struct Levels {
    legs: Vec<Leg>,
    /// Slope of the drive over the response, as long as there is one level.
    slope: f64,
    /// Share of a straight line that is followed: [`CAUTIOUS`] unless the sweep has passed the requested drive.
    share: f64,
    /// Levels whose drives differ by noise only say nothing of a slope, and the last one of them stays alone.
    by_noise: bool,
}

/// Where held levels predict the requested drive, or the drive that is nearest to it.
#[derive(Debug, Clone, Copy)]
struct Predicted {
    /// m
    response: f64,
    /// Slope of the drive over the response there.
    slope: f64,
    /// Slope of the frequency over the response there, rad/s per m.
    turning: f64,
    /// The requested drive is there.
    is_root: bool,
}

impl Levels {
    fn add(&mut self, leg: Leg) {
        self.legs.retain(|level| level.response != leg.response);
        if self.by_noise {
            let noise = |level: &Leg| SIGNIFICANT * level.noise.hypot(leg.noise);
            self.legs.retain(|level| (level.drive - leg.drive).abs() > noise(level));
        }
        self.legs.push(leg);
        self.legs.sort_by(|one, other| one.response.total_cmp(&other.response));
    }

    /// Whether no level has been held here, m.
    fn is_new(&self, to: f64) -> bool {
        self.legs
            .iter()
            .all(|level| (level.response - to).abs() > RESPONSE_FOUND * to)
    }

    /// The prediction by the parabola through three levels: two between which the drive passes the requested one, rising with the response
    /// or, for `any`, falling; otherwise those about the level whose drive is nearest to it.
    fn predict(&self, requested: f64, any: bool) -> Option<Predicted> {
        let beyond = |n: usize| self.legs[n].drive - requested;
        let pairs = 1..self.legs.len();
        let rises = |n: &usize| beyond(n - 1) <= 0.0 && beyond(*n) >= 0.0;
        let falls = |n: &usize| any && beyond(n - 1) >= 0.0 && beyond(*n) <= 0.0;
        let between = pairs.clone().find(rises).or_else(|| pairs.clone().find(falls));
        let nearest = pairs.min_by(|n, m| {
            let distance = |n: usize| beyond(n - 1).abs().min(beyond(n).abs());
            distance(*n).total_cmp(&distance(*m))
        });
        let Some(upper) = between.or(nearest) else {
            let [leg] = &self.legs[..] else { return None };
            return Some(Predicted {
                response: leg.response - self.share * (leg.drive - requested) / self.slope,
                slope: self.slope,
                turning: f64::INFINITY,
                is_root: true,
            });
        };
        let [a, b] = [self.legs[upper - 1], self.legs[upper]];
        let width = b.response - a.response;
        // The third level: the nearest to the two.
        let distance = |leg: &Leg| (leg.response - 0.5 * (a.response + b.response)).abs();
        let others = self
            .legs
            .iter()
            .enumerate()
            .filter(|(n, _)| *n != upper && n + 1 != upper);
        let third = others
            .map(|(_, leg)| leg)
            .min_by(|one, other| distance(one).total_cmp(&distance(other)));
        let line = (b.drive - a.drive) / width;
        let bend = third.map_or(0.0, |c| {
            ((c.drive - b.drive) / (c.response - b.response) - line) / (c.response - a.response)
        });
        // Beyond a: offset + rise u + bend u².
        let (offset, rise) = (a.drive - requested, line - bend * width);
        let square = rise * rise - 4.0 * bend * offset;
        let is_root = square >= 0.0;
        let ahead = if is_root {
            // Of both roots the one where the drive rises, unless it is known to fall.
            let slope = if line < 0.0 && (between.is_some() || any && third.is_none()) {
                -square.sqrt()
            } else {
                square.sqrt()
            };
            -2.0 * offset / (rise + slope)
        } else {
            -0.5 * rise / bend
        };
        let response = a.response + ahead;
        // Beyond two levels, nothing is known of the bend.
        let nearest = if beyond(upper).abs() < beyond(upper - 1).abs() {
            b.response
        } else {
            a.response
        };
        let share = if between.is_none() && third.is_none() {
            self.share
        } else {
            1.0
        };
        let response = nearest + share * (response - nearest);
        let [lowest, .., highest] = &self.legs[..] else {
            return None;
        };
        let span = (LEG_CHANGE * highest.response).max(highest.response - lowest.response);
        let is_near = (lowest.response - span..highest.response + span).contains(&response);
        is_near.then(|| Predicted {
            response,
            slope: rise + 2.0 * bend * ahead,
            turning: (b.omega - a.omega) / width,
            is_root,
        })
    }
}
