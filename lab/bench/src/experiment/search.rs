//! The way to a lock at the requested drive, from rest or with a moving particle.
//!
//! Near phase resonance a rig obeys `A' = g (E cos phi - E_R(A))`: under control of the response A, the drive `E_R(A)` that holds it is
//! single-valued. The script therefore moves the setpoint of the response, and measures `E_R` by this balance, leg by leg.
//!
//! 1. The loop closes under the requested drive.
//! 2. The response rises until it departs from the linear response: impacts have begun.
//! 3. It falls in small steps until the motion is symmetric 1:1 and the drive that holds it falls through the requested one.
//! 4. Newton's method on the measured `E_R(A)` goes to the requested drive. There, a constant drive takes over if `E_R` rises with the
//!    amplitude, which is the condition of stability under a constant drive. Otherwise the response stays under control.

use std::f64::consts::TAU;

use nalgebra::DVector;
use vines_model::numerics::{HarmonicBasis, mean, noise};

use super::{Bench, ExperimentError, Plan, Stage, drive_phases};
use crate::identification::Cycle;
use crate::rig::{Command, Controller, ControllerError, LoopState, Move, Rig};
use crate::scene::LinearResponse;

/// Phase error, rad, below which the control of the response begins: the drive then does 94 % of its largest work. Periods for which.
const NEAR: f64 = 0.35;
const NEAR_FOR: usize = 3;
/// Fewest periods of a leg: the loops, whose slowest time constant is five periods, follow its changes.
const SHORTEST: f64 = 8.0;
/// Largest relative change of the response in a leg: the stable orbits above the fold span a few percent.
const STEP: f64 = 0.04;
/// Largest share of the drive that may change the response.
const SHARE: f64 = 0.3;
/// Periods in which the response rises by the half-width.
const RISE: f64 = 60.0;
/// Largest relative growth of the response in a period: the detector, whose time constant is one to two periods, follows it.
const GROWTH: f64 = 0.1;
/// Departure from the linear response that shows impacts, as a share of the drive.
const DEPARTURE: f64 = 0.2;
/// Largest amplitude of the second harmonic of a symmetric motion, over that of the third.
const SYMMETRIC: f64 = 0.5;
/// Relative distance of the holding drive from the requested one at which a constant drive takes over.
const ARRIVED: f64 = 2e-4;
/// Fall of the response after the end of the symmetric motion from which on it is not found again below: its stable range is wider.
const LOST: f64 = 0.8;
/// Measurements of a response that is not yet steady.
const LONGEST: u32 = 6;
/// Smallest slope of the holding drive that a constant drive needs, over that of the linear response: with less, it takes ten times
/// as long to settle.
const FIRM: f64 = 0.1;
/// Uncertainty of the half-width of the drawing.
const DRAWING: f64 = 0.1;
/// Searches, each in steps half as large as the one before.
const SEARCHES: u32 = 4;

/// One period of the response.
struct Period {
    cycle: Cycle,
    /// Amplitude, m, at the middle.
    amplitude: f64,
    /// Phase of the response, rad.
    phase: f64,
    /// Work of the drive: its amplitude, m, in phase with the velocity.
    work: f64,
    /// Squares of second and third harmonic, and their variance by noise, m².
    even: f64,
    odd: f64,
    noise: f64,
}

/// What a leg measured.
#[derive(Debug, Clone, Copy)]
struct Leg {
    /// Mean response amplitude, m, its change, and the last one.
    response: f64,
    change: f64,
    last: f64,
    /// Drive that changes the response, m.
    unsteady: f64,
    /// Drive that holds it, m.
    holding: f64,
    /// Frequency of the response, rad/s.
    omega: f64,
    /// Second over third harmonic.
    asymmetry: f64,
    /// Whether impacts take a part of the drive.
    departed: bool,
}

impl Leg {
    fn is_symmetric(&self) -> bool {
        self.departed && self.asymmetry < SYMMETRIC
    }
}

/// How the search ended.
pub(super) enum Found {
    /// Locked at a constant drive.
    Locked(Command),
    /// The response is held where the requested drive holds it.
    Held(Command),
}

/// The search.
pub(super) struct Search<'b, 'a, R: Rig + ?Sized, C: ?Sized> {
    bench: &'b mut Bench<'a, R, C>,
    plan: &'b Plan<'b>,
    linear: LinearResponse,
    /// Requested drive, m.
    asked: f64,
    target: f64,
    /// s
    period: f64,
    setpoint: f64,
    last: Command,
}

impl<'b, 'a, R: Rig + ?Sized, C: Controller + ?Sized> Search<'b, 'a, R, C> {
    pub fn new(bench: &'b mut Bench<'a, R, C>, plan: &'b Plan<'b>) -> Self {
        let scene = plan.scene;
        Self {
            bench,
            plan,
            linear: scene.measured.unwrap_or_else(|| LinearResponse::of(scene)),
            asked: scene.amplitude,
            target: scene.phase_target().radians(),
            period: scene.dimensionless().natural_period(),
            setpoint: 0.0,
            last: Command::default(),
        }
    }

    fn gain(&self, omega: f64) -> f64 {
        let omega0 = self.plan.scene.dimensionless().omega0;
        0.5 * omega0 * omega0 / omega
    }

    /// One sample.
    fn sample(&mut self) -> Result<(), ExperimentError> {
        self.last = self.bench.sample(Stage::Locking)?;
        if self.bench.samples.len() >= self.plan.lock {
            return Err(self.bench.no_lock(&self.last));
        }
        Ok(())
    }

    /// One period of the drive; `None` without a motion.
    fn one_period(&mut self) -> Result<Option<Period>, ExperimentError> {
        let begin = self.bench.samples.len();
        let first = self.bench.periods;
        while self.bench.periods < first.floor() + 1.0 {
            self.sample()?;
        }
        let samples = &self.bench.samples[begin..];
        let Some(cycle) = Cycle::of(samples, self.bench.sample_time, first * TAU, self.target) else {
            return Ok(None);
        };
        let phases = drive_phases(samples, self.bench.sample_time, first * TAU);
        let middle = mean(phases.iter().copied());
        let half = 0.5 * (samples.len() - 1) as f64;
        let phases: Vec<f64> = (0..samples.len())
            .map(|n| middle + (n as f64 - half) * self.bench.sample_time * cycle.omega)
            .collect();
        let basis = HarmonicBasis::new(&phases, 0, &[Some(1), Some(0), Some(0), Some(0), Some(0)]);
        let values = DVector::from_iterator(samples.len(), samples.iter().map(|one| one.sensors.response));
        let Some(fit) = basis.fit(&values) else {
            return Ok(None);
        };
        let rest = noise(basis.residual(&values, &fit).as_slice());
        let [one, two, three] = [1, 2, 3].map(|n| fit.harmonic(n));
        let amplitude = mean(samples.iter().map(|one| one.command.drive.amplitude));
        Ok(Some(Period {
            amplitude: one.norm(),
            phase: cycle.drive_phase + one.arg(),
            work: amplitude * cycle.phase_error.cos(),
            even: two.norm_sqr(),
            odd: three.norm_sqr(),
            noise: rest * rest * 4.0 / samples.len() as f64,
            cycle,
        }))
    }

    /// Measures over at least this many periods.
    fn measure(&mut self, periods: f64) -> Result<Leg, ExperimentError> {
        let mut all: Vec<Period> = Vec::new();
        while (all.len() as f64) < periods {
            all.extend(self.one_period()?);
            if self.last.settled && all.len() > 3 {
                break;
            }
        }
        let (first, last) = (&all[0], &all[all.len() - 1]);
        let duration = last.cycle.time - first.cycle.time;
        let omega = mean(all.iter().map(|one| one.cycle.omega));
        let change = last.amplitude - first.amplitude;
        let work = mean(all.windows(2).map(|pair| 0.5 * (pair[0].work + pair[1].work)));
        let gain = self.gain(omega);
        let holding = work - change / (gain * duration);
        let response = mean(all.iter().map(|one| one.amplitude));
        let turned: f64 = all
            .windows(2)
            .map(|pair| {
                let turn = pair[1].cycle.drive_phase - pair[0].cycle.drive_phase;
                let more = (pair[1].phase - pair[0].phase - turn + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
                turn + more
            })
            .sum();
        // The frequency at phase resonance, without the part that a phase error adds.
        let turning = gain * mean(all.iter().map(|one| one.work * one.cycle.phase_error.tan())) / response;
        let omega_r = turned / duration + turning;
        let sum = |value: fn(&Period) -> f64| all.iter().map(value).sum::<f64>();
        let noise = sum(|one| one.noise);
        let even = (sum(|one| one.even) - noise).max(0.0);
        let odd = (sum(|one| one.odd) - noise).max(0.0);
        let needs = self.linear.damping_rate / gain * response;
        let departure = (holding - needs).hypot(response * (omega_r - self.linear.omega0) / gain);
        let leg = Leg {
            response,
            change,
            last: last.amplitude,
            unsteady: work - holding,
            holding,
            omega: omega_r,
            asymmetry: (even / odd).sqrt(),
            departed: departure > DEPARTURE * needs.max(work),
        };
        if std::env::var_os("VINES_TRACE").is_some() {
            let d = self.plan.scene.dimensionless();
            eprintln!(
                "{:8.1} n {:3} set {:.4} C {:.5} dC {:+.4} G {:.5} of {:.4} sigma {:+.4} asym {:.3} dep {} {:?} E {:.4}",
                self.bench.periods,
                all.len(),
                self.setpoint / d.b,
                response / d.b,
                change / d.b,
                d.excitation(holding),
                d.g,
                d.sigma(omega_r),
                leg.asymmetry,
                departure / needs.max(work),
                self.last.state,
                d.excitation(mean(all.iter().map(|one| one.work))),
            );
        }
        Ok(leg)
    }

    /// Moves the setpoint in a leg of so many periods, with the growth `onward`, m/s, at its end; measures.
    fn leg(&mut self, to: f64, periods: f64, onward: f64) -> Result<Leg, ExperimentError> {
        let go = Move {
            response: to,
            duration: periods * self.period,
            growth: onward,
            ..Move::default()
        };
        self.bench.controller.hold_response(go, self.target)?;
        self.setpoint = to;
        self.measure(periods)
    }

    /// Measures until the late impacts falsify the holding drive by little, compared with its distance from the requested one.
    fn hold(&mut self, slope: f64) -> Result<Leg, ExperimentError> {
        let mut seen = self.measure(SHORTEST)?;
        for _ in 0..LONGEST {
            let missing = (seen.holding - self.asked).abs();
            let allowed = (0.1 * missing).max(self.tolerance(slope, seen.response));
            if LATE * seen.unsteady.abs() < allowed || !seen.is_symmetric() {
                break;
            }
            seen = self.measure(SHORTEST)?;
        }
        Ok(seen)
    }

    /// Periods for a change of the response by `change`, m, against the holding drive.
    fn periods(&self, change: f64, holding: f64) -> f64 {
        let rate = SHARE * self.gain(self.linear.omega0) * holding.max(0.1 * self.asked);
        (change.abs() / (rate * self.period)).max(SHORTEST).ceil()
    }

    /// Runs the script; `None` where the controller cannot control the response.
    pub fn run(&mut self) -> Result<Option<Found>, ExperimentError> {
        let mut near = 0;
        while near < NEAR_FOR {
            let period = self.one_period()?;
            let closed = matches!(self.last.state, Some(LoopState::Acquiring | LoopState::Locked));
            let is_near = period.is_some_and(|one| {
                self.setpoint = one.amplitude;
                one.cycle.phase_error.abs() < NEAR && one.cycle.base.norm() > 0.0
            });
            near = if closed && is_near { near + 1 } else { 0 };
        }
        let mut seen = match self.leg(self.setpoint, SHORTEST, 0.0) {
            Err(ExperimentError::Controller(ControllerError::NoResponseLoop)) => return Ok(None),
            seen => seen?,
        };
        let mut unstable = false;
        for search in 0..SEARCHES {
            if !seen.is_symmetric() {
                seen = self.rise(seen)?;
            }
            match self.follow(seen, f64::from(1 << search), unstable)? {
                Outcome::Found(found) => return Ok(Some(found)),
                Outcome::Lost { last, crossed } => (seen, unstable) = (last, unstable | crossed),
            }
        }
        Err(self.bench.no_lock(&self.last))
    }

    /// Raises the response until impacts have begun or the motion is symmetric.
    fn rise(&mut self, mut seen: Leg) -> Result<Leg, ExperimentError> {
        let scene = self.plan.scene;
        let d = scene.dimensionless();
        let gain = self.gain(d.omega0);
        let most = d.amplitude(scene.g_max());
        let spare = gain * (most - 1.2 * d.b * self.linear.damping_rate / gain);
        let rate = (d.b / (RISE * self.period)).min(0.3 * spare);
        let periods = 5.0;
        loop {
            let rate = rate.min(GROWTH * seen.last / self.period);
            let to = self.setpoint + rate * periods * self.period;
            if to > 1.5 * d.b {
                return Ok(seen);
            }
            seen = self.leg(to, periods, rate)?;
            if seen.is_symmetric() || seen.departed && seen.response > (1.0 - DRAWING) * d.b {
                return Ok(seen);
            }
        }
    }

    /// Goes along the symmetric motion to the requested drive, `slower` times as slowly as at first.
    fn follow(&mut self, first: Leg, slower: f64, unstable: bool) -> Result<Outcome, ExperimentError> {
        let (mut seen, mut backbone) = (first, Backbone::default());
        let mut symmetric = seen.is_symmetric();
        let mut rising = symmetric && seen.holding < self.asked;
        // Whether the requested drive may be above, and whether a larger one was seen.
        let (mut upwards, mut exceeded, mut crossed) = (true, false, false);
        let (mut other, mut lowest) = (0, 0.0);
        loop {
            let largest = STEP / slower * seen.response;
            let slope = backbone.slope();
            let ahead = slope
                .filter(|slope| symmetric && other == 0 && (*slope > 0.0 || unstable))
                .and_then(|_| backbone.at(self.asked))
                .map(|ahead| ahead - seen.last)
                .filter(|change| *change < 0.0 || upwards || exceeded);
            let change = ahead.unwrap_or(if rising { largest } else { -largest });
            let change = change.clamp(-largest, largest);
            rising = change > 0.0;
            let periods = self.periods(slower * change, seen.holding);
            let to = self.setpoint + change;
            seen = if change.abs() == largest {
                self.leg(to, periods, change / (periods * self.period))?
            } else {
                self.leg(to, 0.5 * periods, 0.0)?;
                self.hold(backbone.slope().unwrap_or_default())?
            };
            let missing = seen.holding - self.asked;
            if !seen.is_symmetric() {
                other += 1;
                if symmetric && other >= 2 {
                    // Above the symmetric motion, the way is down; below the fold, nothing is.
                    (symmetric, upwards, exceeded, rising) = (false, false, false, false);
                    lowest = LOST * seen.response;
                }
                if !seen.departed || seen.response < lowest {
                    return Ok(Outcome::Lost { last: seen, crossed });
                }
                continue;
            }
            (symmetric, other) = (true, 0);
            exceeded |= missing > 0.0;
            backbone.add(seen);
            let slope = backbone.slope();
            if slope.is_some() {
                rising = false;
            }
            let Some(slope) = slope else { continue };
            crossed |= slope < 0.0 && backbone.encloses(self.asked);
            // What the constant drive would change in a leg, and in all; and by how much it relaxes in a leg.
            let rate = self.gain(seen.omega) * SHORTEST * self.period;
            let changes = (rate * missing.abs()).min(missing.abs() / slope.abs());
            let tolerance = self.tolerance(slope, seen.response);
            let has_arrived = missing.abs() < tolerance && LATE * seen.unsteady.abs() < tolerance;
            let firm = self.linear.damping_rate / self.gain(seen.omega) * FIRM;
            if has_arrived && slope < firm {
                return Ok(Outcome::Found(Found::Held(self.last)));
            }
            if slope > 0.0 && (has_arrived || changes < largest && rate * slope > 0.5) {
                match self.hand_over()? {
                    Some(found) => return Ok(Outcome::Found(found)),
                    None => {
                        seen = self.leg(self.setpoint, SHORTEST, 0.0)?;
                        (symmetric, upwards, exceeded, rising) = (false, false, false, false);
                        lowest = LOST * seen.response;
                    }
                }
            }
        }
    }

    /// Largest error of the holding drive, m, at the end: as much as changes the response by the same share.
    fn tolerance(&self, slope: f64, response: f64) -> f64 {
        ARRIVED * (slope.abs() * response).clamp(0.05 * self.asked, self.asked)
    }

    /// Hands over to the constant drive; `None` if the motion does not stay symmetric.
    fn hand_over(&mut self) -> Result<Option<Found>, ExperimentError> {
        self.bench.controller.hold_drive()?;
        let mut other = 0;
        while other < 2 {
            let seen = self.measure(SHORTEST)?;
            if self.last.settled {
                return Ok(Some(Found::Locked(self.last)));
            }
            other = if seen.is_symmetric() { 0 } else { other + 1 };
            self.setpoint = seen.last;
        }
        Ok(None)
    }
}

/// The measured backbone: the present point, and the last ones that tell its slope, the latest first.
#[derive(Default)]
struct Backbone {
    present: Option<Leg>,
    points: Vec<Leg>,
}

/// Relative difference of the responses of two points that give a slope.
const APART: f64 = 3e-3;
/// Share of the drive that changes the response, by which the holding drive of a motion that is not steady may be wrong: the impacts
/// follow late. Up and down at epsilon = 0.015, r = 0.9, it was 0.02.
const LATE: f64 = 0.05;

impl Backbone {
    fn add(&mut self, seen: Leg) {
        self.present = Some(seen);
        let tells = |point: &Leg| {
            let late = LATE * (point.unsteady - seen.unsteady).abs();
            (point.response / seen.response - 1.0).abs() >= APART && (point.holding - seen.holding).abs() >= late
        };
        if self.points.first().is_none_or(tells) {
            self.points.insert(0, seen);
            self.points.truncate(3);
        }
    }

    /// Slope of the holding drive over the response.
    fn slope(&self) -> Option<f64> {
        let [one, two, ..] = &self.points[..] else { return None };
        Some((one.holding - two.holding) / (one.response - two.response))
    }

    /// Whether this drive, m, lies between those of the last two points.
    fn encloses(&self, drive: f64) -> bool {
        let [one, two, ..] = &self.points[..] else { return false };
        (one.holding - drive) * (two.holding - drive) < 0.0
    }

    /// The response, m, that this drive, m, holds: as a quadratic function of the drive, which has no singularity at the fold.
    fn at(&self, drive: f64) -> Option<f64> {
        let [one, two, ..] = &self.points[..] else { return None };
        let inverse = |a: &Leg, b: &Leg| (a.response - b.response) / (a.holding - b.holding);
        let slope = inverse(one, two);
        let bend = self.points.get(2).map_or(0.0, |three| {
            (slope - inverse(two, three)) / (one.holding - three.holding)
        });
        let share = 1.0 + (drive - two.holding) * bend / slope;
        let present = self.present.as_ref()?;
        Some(present.response + (drive - present.holding) * slope * share.clamp(0.25, 1.5))
    }
}

/// How a descent ended.
enum Outcome {
    Found(Found),
    /// The motion was lost; `crossed`: the requested drive holds an unstable one.
    Lost { last: Leg, crossed: bool },
}
