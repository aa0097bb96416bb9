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

use std::f64::consts::TAU;

use nalgebra::DVector;
use vines_model::numerics::{Estimate, HarmonicBasis, SIGNIFICANT, mean, noise, range};

use super::{CONFIRMED, ControlLoop, ExperimentError, FOLLOWED, Sample, Stage};
use crate::identification::{ASYMMETRIC, Cycle, ResonanceFit, Slopes, degrees, without_tones};
use crate::linear::{Impacts, impacts_by_resonance};
use crate::plan::{LinearResponse, Plan, Target};
use crate::rig::{Controller, ControllerError, LoopState, Move, Rig};
use crate::scene::Measurand;

/// Phase error, rad, below which the control of the response begins: the drive then does 94 % of its largest work.
const NEAR: f64 = 0.35;
/// Largest relative change of the response in a leg: the stable orbits above the fold span a few percent.
const STEP: f64 = 0.04;
/// Largest share of the drive that changes the response.
const SHARE: f64 = 0.3;
/// Duration of a rise of the response by the half-width, periods.
const RISE: f64 = 60.0;
/// Largest relative error of the half-width in the drawing.
const DRAWING: f64 = 0.1;
/// Response over the half-width from which impacts are no longer expected: the particle does not move freely.
const UNREACHED: f64 = 1.5;
/// Smallest response over the half-width of the search: up to r = 0.9, the fold has a larger one.
const LOWEST: f64 = 0.05;
/// Smallest response, over the response where the symmetry was lost or the lock was found, at which the motion counts as the same; the largest is
/// its inverse. The stable range of the symmetric motion is wider.
const LOST: f64 = 0.8;
/// Smallest slope of the holding drive over the response under a constant drive, over the slope of the linear response: with less, the motion
/// takes ten times as long to settle.
const SMALLEST_SLOPE: f64 = 0.1;
/// Relative error of the drive, or of the response if that is larger, at which the response that the requested drive holds has been found.
const FOUND: f64 = 1e-4;
/// Largest number of steps of the interpolation; then the motion is left to settle where it is.
const LEGS: u32 = 20;
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
    /// Whether frequency and loss need impacts.
    departed: bool,
    symmetric: bool,
    /// Second harmonic over the third, as far as noise does not explain it.
    asymmetry: f64,
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
        }
    }

    /// Goes to the lock at the requested drive. Returns whether the response is held by control there, or `None` where the controller cannot
    /// control it.
    pub fn lock(&mut self) -> Result<Option<bool>, ExperimentError> {
        let mut leg = match self.begin() {
            Err(ExperimentError::Controller(ControllerError::NoResponseLoop(_))) => return Ok(None),
            leg => leg?,
        };
        for search in 0..SEARCHES {
            let step = STEP / f64::from(1 << search);
            leg = self.symmetric(leg, step)?;
            if let Some(held) = self.solve(&mut leg, step, search >= SEARCHES / 2)? {
                return Ok(Some(held));
            }
        }
        Err(self.not_reached())
    }

    /// Goes to a symmetric motion with impacts, if there is one, and holds its response.
    pub fn impacts(&mut self) -> Result<(), ExperimentError> {
        let leg = self.begin()?;
        self.symmetric(leg, STEP)?;
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
                cycle.phase_error.abs() < NEAR
            });
            near = if closed && is_near { near + 1 } else { 0 };
        }
        self.leg(0.0, FOLLOWED, 0.0)
    }

    /// Goes to a symmetric motion with impacts: raises the response until they have begun, and lowers it until the motion is symmetric.
    fn symmetric(&mut self, mut leg: Leg, step: f64) -> Result<Leg, ExperimentError> {
        let largest = self.bench.config.amplitude_max.unwrap_or(f64::INFINITY);
        let spare = SHARE * self.gain() * (largest - self.damping() * (1.0 + DRAWING) * self.b);
        let rate = (self.b / (RISE * self.period)).min(spare);
        while !leg.departed || leg.response < (1.0 - DRAWING) * self.b {
            if leg.symmetric {
                // A rise may resemble impacts; at rest the setpoint tells them apart.
                leg = self.leg(0.0, FOLLOWED, 0.0)?;
                if leg.symmetric {
                    return Ok(leg);
                }
            }
            let change = rate * FOLLOWED as f64 * self.period;
            if leg.last + change > UNREACHED * self.b || rate <= 0.0 {
                break;
            }
            leg = self.leg(leg.last + change - self.setpoint, FOLLOWED, rate)?;
        }
        self.fall(leg, step, LOWEST * self.b)
    }

    /// Lowers the response until the motion is symmetric, but not below `lowest`, m, nor on after impacts have ended, of which even harmonics
    /// are a sign as well. A large response can hide them: beside a carried particle, their evidence grows as the response falls.
    fn fall(&mut self, mut leg: Leg, step: f64, lowest: f64) -> Result<Leg, ExperimentError> {
        let mut seen = leg.departed;
        while !leg.symmetric && (leg.departed || leg.asymmetry > 0.0 || !seen) && self.setpoint > lowest {
            leg = self.sweep(&leg, -step * leg.last)?;
            seen |= leg.departed;
        }
        Ok(leg)
    }

    /// Follows the symmetric motion to the response that the requested drive holds. Returns whether it stays under control there; `None` if
    /// the motion is lost. `any`: also one that a constant drive does not hold.
    fn solve(&mut self, leg: &mut Leg, step: f64, any: bool) -> Result<Option<bool>, ExperimentError> {
        let (mut points, mut passed, mut legs) = (BackbonePoints::from(*leg), false, 0);
        let mut upwards = leg.drive < self.requested;
        while leg.symmetric && self.setpoint > LOWEST * self.b && legs < LEGS {
            let most = step * leg.last;
            let way = if upwards { most } else { -most };
            // From where the response is: it follows its setpoint late.
            let wanted = points.slope().is_some_and(|slope| any || slope > 0.0);
            let predicted = points.at(self.requested).map(|to| to - leg.last);
            let change = predicted.filter(|change| wanted && (passed || change * way > 0.0));
            *leg = match change {
                Some(change) if change.abs() < most => {
                    legs += 1;
                    let to = leg.last + change - self.setpoint;
                    self.leg(to, self.periods(change, leg) / 2, 0.0)?;
                    self.leg(0.0, FOLLOWED, 0.0)?
                }
                change => self.sweep(leg, change.map_or(way, |change| change.clamp(-most, most)))?,
            };
            if !leg.symmetric {
                // A change may disturb the symmetry for a while.
                *leg = self.leg(0.0, FOLLOWED, 0.0)?;
            }
            if !leg.symmetric {
                (points, passed, upwards) = (self.below(leg, step)?, false, false);
                continue;
            }
            let between = points.add(*leg, 0.5 * step, self.requested);
            let Some(slope) = points.slope().filter(|slope| any || *slope > 0.0) else {
                passed = false;
                continue;
            };
            passed |= between;
            let scale = (slope.abs() * leg.response).clamp(SMALLEST_SLOPE * self.requested, self.requested);
            let is_found = (self.requested - leg.drive).abs() < (FOUND * scale).max(leg.noise);
            // The condition of stability under a constant drive.
            // Behind a shaker a constant command is no constant force: the response stays under control.
            let is_stable = !self.target.through_shaker && slope > SMALLEST_SLOPE * self.damping();
            if is_found || is_stable && legs == LEGS {
                if is_stable {
                    self.bench.controller.hold_drive()?;
                }
                if self.settle(leg)? {
                    return Ok(Some(!is_stable));
                }
                (points, passed, upwards) = (self.below(leg, step)?, false, false);
            }
        }
        Ok(None)
    }

    /// Goes down to the symmetric motion from where it was lost: above it is a motion without symmetry.
    fn below(&mut self, leg: &mut Leg, step: f64) -> Result<BackbonePoints, ExperimentError> {
        *leg = self.fall(*leg, step, LOST * leg.response)?;
        Ok(BackbonePoints::from(*leg))
    }

    /// Waits until the lock has settled. Returns whether it has; if not, the motion has lost its symmetry.
    fn settle(&mut self, leg: &mut Leg) -> Result<bool, ExperimentError> {
        let (mut asymmetric, mut grown, first) = (0, 0, leg.response);
        while asymmetric < 2 {
            let before = leg.asymmetry;
            *leg = self.measure(FOLLOWED)?;
            // Beside symmetry breaking the symmetry is lost slowly; noise grows as often in one of 24 cases.
            grown = if leg.asymmetry > before { grown + 1 } else { 0 };
            if self.bench.settled && grown < CONFIRMED {
                return Ok(true);
            }
            // Noise may hide an asymmetry, but not where the motion goes.
            let is_there = (LOST..1.0 / LOST).contains(&(leg.response / first));
            asymmetric = if leg.symmetric && is_there { 0 } else { asymmetric + 1 };
            self.setpoint = leg.last;
        }
        Ok(false)
    }

    /// A leg that changes the response by `change`, m, and lets it go on at this rate.
    fn sweep(&mut self, leg: &Leg, change: f64) -> Result<Leg, ExperimentError> {
        let periods = self.periods(STEP * leg.response, leg);
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
        let rate = SHARE * self.gain() * leg.drive.max(SMALLEST_SLOPE * self.requested);
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

    /// Measures over `periods`, or until the lock has settled.
    fn measure(&mut self, periods: usize) -> Result<Leg, ExperimentError> {
        let mut begins = Vec::new();
        while begins.len() < periods.max(ResonanceFit::FEWEST)
            && !(self.bench.settled && begins.len() >= ResonanceFit::FEWEST)
        {
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
            harmonics.extend(even_and_odd(two, step * cycle.omega, self.target.measurands[0]));
            all.push(cycle);
        }
        let Some(fit) = ResonanceFit::of(&all, &self.bench.plan.knowledge, Slopes::Unknown) else {
            return self.measure(periods);
        };
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
        let (even, odd) = (even - noise, odd - noise);
        let doubtful = SIGNIFICANT * noise / (0.5 * all.len() as f64).sqrt();
        let possible = self.setpoint > LOWEST * self.b && response < UNREACHED * self.b;
        // Without mirror images there is no symmetric motion to tell from others.
        // As displacements.
        let asymmetric = ASYMMETRIC * (2.0_f64 / 3.0).powi(self.target.measurands[0].order());
        let is_even_small =
            !self.bench.plan.knowledge.is_symmetric || even <= (asymmetric * asymmetric * odd).max(doubtful);
        let symmetric = departed && possible && is_even_small;
        if symmetric {
            self.held = range(self.held, [drive.value]);
        }
        Ok(Leg {
            response,
            last: all[all.len() - 1].amplitude(),
            drive: drive.value,
            noise: drive.uncertainty,
            departed,
            symmetric,
            asymmetry: ((even - doubtful).max(0.0) / odd.max(doubtful)).sqrt(),
        })
    }

    /// The requested drive was not reached.
    fn not_reached(&self) -> ExperimentError {
        let (d, (low, high)) = (self.bench.plan.knowledge.numbers, self.held);
        ExperimentError::NotReached {
            periods: self.bench.periods,
            g: d.g,
            held: (low <= high).then(|| [low, high].map(|drive| d.excitation(drive))),
            searches: SEARCHES,
            highest: self.setpoint / self.b,
        }
    }
}

/// Squares of the second and the third harmonic of the response, m², and their mean by noise; `step` is the phase between two samples, rad.
fn even_and_odd(samples: &[Sample], step: f64, measurand: Measurand) -> Option<[f64; 3]> {
    let phases: Vec<f64> = (0..samples.len()).map(|n| n as f64 * step).collect();
    let basis = HarmonicBasis::new(&phases, 0, &degrees(measurand, TAU / step));
    let values = DVector::from_iterator(samples.len(), samples.iter().map(|sample| sample.sensors.response));
    let fit = basis.fit(&values)?;
    let rest = noise(basis.residual(&values, &fit).as_slice());
    let [even, odd] = [2, 3].map(|n| fit.harmonic(n).norm_sqr());
    Some([even, odd, rest * rest * 4.0 / samples.len() as f64])
}

/// The last points of the backbone, at most three.
struct BackbonePoints(Vec<Leg>);

impl From<Leg> for BackbonePoints {
    fn from(first: Leg) -> Self {
        Self(vec![first])
    }
}

impl BackbonePoints {
    /// Adds a point, or replaces the last one if they are less apart than the share `apart` or noise. Returns whether the drive `requested` lies
    /// between the two.
    fn add(&mut self, leg: Leg, apart: f64, requested: f64) -> bool {
        let last = self.0[self.0.len() - 1];
        let difference = (leg.drive - last.drive).abs();
        let is_new = (leg.response / last.response - 1.0).abs() > apart
            && difference > SIGNIFICANT * leg.noise.hypot(last.noise);
        if !is_new {
            self.0.pop();
        }
        self.0.push(leg);
        if self.0.len() > 3 {
            self.0.remove(0);
        }
        (last.drive - requested) * (leg.drive - requested) <= 0.0
    }

    /// Slope of the holding drive over the response.
    fn slope(&self) -> Option<f64> {
        let [.., two, last] = &self.0[..] else { return None };
        Some((last.drive - two.drive) / (last.response - two.response))
    }

    /// The response, m, that this drive, m, holds, on the parabola through the last points over the drive, which has no singularity at the fold;
    /// but at most as far as on the line through the last two, and at least half as far.
    fn at(&self, drive: f64) -> Option<f64> {
        let [.., two, last] = &self.0[..] else { return None };
        let inverse = |a: &Leg, b: &Leg| (a.response - b.response) / (a.drive - b.drive);
        let line = inverse(last, two);
        let bend = match &self.0[..] {
            [three, two, last] => (line - inverse(two, three)) / (last.drive - three.drive),
            _ => 0.0,
        };
        let share = 1.0 + bend / line * (drive - two.drive);
        let slope = line * share.clamp(0.5, 1.0);
        Some(last.response + slope * (drive - last.drive))
    }
}
