//! The way to a lock at the requested drive, from rest or with a moving particle.
//!
//! Near phase resonance a rig obeys `A' = g (E cos phi - E_R(A))`, whatever is inside it. While the response A is controlled, the drive
//! `E_R(A)` that holds it is single-valued. The script moves the setpoint of the response in legs, and measures `E_R` by this balance.
//!
//! 1. The loop closes under the requested drive.
//! 2. The response rises until the motion departs from the linear response: impacts have begun.
//! 3. It falls in small steps until the motion is symmetric 1:1, and goes on until `E_R` falls through the requested drive.
//! 4. Steps of the inverse interpolation of the measured `E_R(A)` lead to the requested drive. There a constant drive takes over if `E_R`
//!    rises with the amplitude, the condition of stability under a constant drive. Otherwise the response stays under control.
//!
//! A motion that is symmetric from the start skips steps 2 and 3. A motion that is lost is searched again, more slowly.

use std::f64::consts::TAU;

use nalgebra::DVector;
use vines_model::numerics::{HarmonicBasis, mean, noise};

use super::{Bench, ExperimentError, Sample, Stage};
use crate::identification::{Cycle, without_tones};
use crate::rig::{Command, Controller, ControllerError, LoopState, Move, Rig};
use crate::scene::{LinearResponse, Scene};

/// Phase error, rad, below which the control of the response begins: the drive then does 94 % of its largest work. Periods for which.
const NEAR: f64 = 0.35;
const NEAR_FOR: usize = 3;
/// Fewest periods of a leg. The loops, whose slowest time constant is five periods, follow within it.
const SHORTEST: f64 = 8.0;
/// Largest relative change of the response in a leg: the stable orbits above the fold span a few percent.
const STEP: f64 = 0.04;
/// Largest share of the drive that changes the response: with half of it, one rig in thirty was lost at the fold.
const SHARE: f64 = 0.3;
/// Periods in which the response rises by the half-width, and those of a leg.
const RISE: f64 = 60.0;
const RISE_LEG: f64 = 5.0;
/// Largest relative growth of the response in a period: the detector, whose time constant is one to two periods, follows it.
const GROWTH: f64 = 0.1;
/// Departure from the linear response that shows impacts, as a share of the drive: twice the uncertainty of damping and stiffness.
const DEPARTURE: f64 = 0.2;
/// Largest amplitude of the second harmonic of a symmetric motion over that of the third: 0.1 is found where it is symmetric, from 2 on
/// where it is irregular.
const SYMMETRIC: f64 = 0.5;
/// The same of a motion whose symmetry does not matter any more; and above it, it must not grow.
const STILL: f64 = 2e-3;
/// Relative error of the half-width in the drawing, and the response over it at which the particle is not reached, as it seems.
const DRAWING: f64 = 0.1;
const UNREACHED: f64 = 1.5;
/// Relative error of the drive, or of the response if that is larger, with which a constant drive takes over; and of a held response.
const ARRIVED: f64 = 2e-4;
const HELD: f64 = 0.1;
/// Smallest slope of the holding drive under a constant drive, over that of the linear response: with less, it takes ten times as long
/// to settle.
const FIRM: f64 = 0.1;
/// Relative distance of the responses of two points that tell a slope.
const APART: f64 = 3e-3;
/// Share of the drive that changes the response, by which the holding drive may be wrong: impacts follow late. At epsilon =
/// 0.015, r = 0.9 it is 0.02, at epsilon = 0.002, r = 0.56 0.4.
const LATE: f64 = 0.05;
/// Standard uncertainties from which on a difference is not noise.
const SIGNIFICANT: f64 = 3.0;
/// Measurements of a response that is not yet steady.
const LONGEST: u32 = 6;
/// Fall of the response without symmetry, from where it was lost, after which the motion is lost: its stable range is wider.
const LOST: f64 = 0.8;
/// Response over the half-width below which no motion is searched for: the fold is above, up to r = 0.9.
const LOWEST: f64 = 0.05;
/// Legs with nearly the requested drive, relative, after which the constant drive is left to settle by itself: where the holding drive
/// hardly depends on the amplitude, the interpolation does not converge.
const NEARLY: f64 = 0.01;
const PATIENCE: u32 = 20;
/// Searches, each twice as slow as the one before.
const SEARCHES: u32 = 4;

/// One period of the response.
struct Period {
    cycle: Cycle,
    /// Amplitude, m, and phase, rad, at the middle.
    amplitude: f64,
    phase: f64,
    /// The drive in phase with the velocity, m.
    work: f64,
    /// Squares of second and third harmonic, and variance of either component of a harmonic by noise, m².
    harmonics: [f64; 2],
    noise: f64,
}

/// What a leg measured.
#[derive(Debug, Clone, Copy)]
struct Leg {
    /// Mean response amplitude, and the last one, m.
    response: f64,
    last: f64,
    /// Drive that holds it, its standard uncertainty by noise, and drive that changes the response, m.
    holding: f64,
    noise: f64,
    unsteady: f64,
    /// Whether impacts take a part of the drive.
    departed: bool,
    symmetric: bool,
    /// Second harmonic over the third, as far as noise does not explain it.
    asymmetry: f64,
}

/// How the search ended.
enum Found {
    /// Locked at a constant drive.
    Locked,
    /// The response is held where the requested drive holds it.
    Held,
    /// The motion was lost; `crossed`: the requested drive holds an unstable one.
    Lost { last: Leg, crossed: bool },
}

/// The search.
pub(crate) struct Search<'b, 'a, R: Rig + ?Sized, C: ?Sized> {
    bench: &'b mut Bench<'a, R, C>,
    scene: &'b Scene,
    linear: LinearResponse,
    /// Time limit, samples.
    limit: usize,
    progress: &'b mut dyn FnMut(usize),
    /// Half-width of the cavity, and requested drive, m.
    b: f64,
    asked: f64,
    /// Phase target, rad.
    target: f64,
    /// Natural period, s.
    period: f64,
    /// Setpoint of the response, m.
    setpoint: f64,
    last: Command,
    /// The symmetric motions of the smallest and the largest holding drive: response and drive, m.
    extremes: Option<[[f64; 2]; 2]>,
}

impl<'b, 'a, R: Rig + ?Sized, C: Controller + ?Sized> Search<'b, 'a, R, C> {
    /// The search on a bench, for at most `limit` samples; `progress` receives their number.
    pub fn new(
        bench: &'b mut Bench<'a, R, C>,
        scene: &'b Scene,
        limit: usize,
        progress: &'b mut dyn FnMut(usize),
    ) -> Self {
        let d = scene.dimensionless();
        Self {
            bench,
            scene,
            linear: scene.measured.unwrap_or_else(|| LinearResponse::of(scene)),
            limit,
            progress,
            b: d.b,
            asked: scene.amplitude,
            target: scene.phase_target().radians(),
            period: d.natural_period(),
            setpoint: 0.0,
            last: Command::default(),
            extremes: None,
        }
    }

    /// Goes to the lock at the requested drive. Returns whether the response is held by control there, or `None` where the controller cannot
    /// control it.
    pub fn lock(&mut self) -> Result<Option<bool>, ExperimentError> {
        let mut seen = match self.begin() {
            Err(ExperimentError::Controller(ControllerError::NoResponseLoop)) => return Ok(None),
            seen => seen?,
        };
        let mut unstable = false;
        for search in 0..SEARCHES {
            let slower = f64::from(1 << search);
            seen = self.symmetric(seen, slower)?;
            if !seen.symmetric {
                continue;
            }
            match self.follow(seen, slower, unstable)? {
                Found::Locked => return Ok(Some(false)),
                Found::Held => return Ok(Some(true)),
                Found::Lost { last, crossed } => (seen, unstable) = (last, unstable | crossed),
            }
        }
        Err(self.not_reached())
    }

    /// Goes to a symmetric motion with impacts, if there is one, and holds its response.
    pub fn impacts(&mut self) -> Result<(), ExperimentError> {
        let seen = self.begin()?;
        self.symmetric(seen, 1.0)?;
        Ok(())
    }

    /// Closes the loop and begins to control the response.
    fn begin(&mut self) -> Result<Leg, ExperimentError> {
        let mut near = 0;
        while near < NEAR_FOR {
            let period = self.one_period()?;
            let state = self.last.state;
            let closed = state.is_none_or(|state| matches!(state, LoopState::Acquiring | LoopState::Locked));
            let is_near = period.is_some_and(|one| {
                self.setpoint = one.amplitude;
                one.cycle.phase_error.abs() < NEAR && one.work > 0.0
            });
            near = if closed && is_near { near + 1 } else { 0 };
        }
        self.leg(self.setpoint, SHORTEST, 0.0)
    }

    /// Goes to a symmetric motion with impacts: raises the response until they have begun, and lowers it until the motion is symmetric.
    fn symmetric(&mut self, mut seen: Leg, slower: f64) -> Result<Leg, ExperimentError> {
        let largest = self.scene.controller_config().amplitude_max.unwrap_or(f64::INFINITY);
        let damping = self.linear.damping_rate / self.gain();
        let spare = SHARE * self.gain() * (largest - (1.0 + DRAWING) * self.b * damping);
        let most = (self.b / (RISE * self.period)).min(spare);
        while !(seen.symmetric || seen.departed && seen.response > (1.0 - DRAWING) * self.b) {
            let rate = most.min(GROWTH * seen.last / self.period);
            let to = self.setpoint + rate * RISE_LEG * self.period;
            if to > UNREACHED * self.b || rate <= 0.0 {
                return Ok(seen);
            }
            seen = self.leg(to, RISE_LEG, rate)?;
        }
        self.fall(seen, slower, LOWEST * self.b)
    }

    /// Lowers the response until the motion is symmetric, but not below `lowest`, m.
    fn fall(&mut self, mut seen: Leg, slower: f64, lowest: f64) -> Result<Leg, ExperimentError> {
        while !seen.symmetric && seen.departed && seen.response > lowest && self.setpoint > LOWEST * self.b {
            seen = self.sweep(&seen, -STEP / slower * seen.response, slower)?;
        }
        Ok(seen)
    }

    /// Follows the symmetric motion to the requested drive. `unstable`: also to one that a constant drive does not hold.
    fn follow(&mut self, first: Leg, slower: f64, unstable: bool) -> Result<Found, ExperimentError> {
        let (mut seen, mut backbone) = (first, Backbone::default());
        let mut rising = seen.holding < self.asked;
        // Whether the requested drive may be above, and whether a larger one was seen.
        let (mut upwards, mut exceeded, mut crossed) = (true, false, false);
        let (mut other, mut legs) = (0, 0);
        loop {
            let largest = STEP / slower * seen.response;
            let ahead = backbone
                .slope()
                .filter(|slope| *slope > 0.0 || unstable)
                .and_then(|_| backbone.at(self.asked))
                .map(|ahead| ahead - seen.last)
                .filter(|change| *change < 0.0 || upwards || exceeded);
            let change = ahead.unwrap_or(if rising { largest } else { -largest });
            rising = change > 0.0;
            seen = if other > 0 {
                // A change may disturb the symmetry for a while.
                self.leg(self.setpoint, SHORTEST, 0.0)?
            } else if change.abs() < largest {
                let periods = self.periods(change, seen.holding).max(SHORTEST);
                self.leg(self.setpoint + change, (0.5 * periods).ceil(), 0.0)?;
                self.hold(backbone.slope().unwrap_or_default())?
            } else {
                self.sweep(&seen, change.clamp(-largest, largest), slower)?
            };
            if !seen.symmetric {
                other += 1;
                if other < 2 {
                    continue;
                }
                // Above the symmetric motion, the way is down; below the fold there is none.
                seen = self.fall(seen, slower, LOST * seen.response)?;
                if !seen.symmetric {
                    return Ok(Found::Lost { last: seen, crossed });
                }
                (upwards, exceeded, rising) = (false, false, false);
            }
            if self.setpoint <= LOWEST * self.b {
                return Ok(Found::Lost { last: seen, crossed });
            }
            other = 0;
            backbone.add(seen);
            let missing = seen.holding - self.asked;
            exceeded |= missing > 0.0;
            let Some(slope) = backbone.slope() else { continue };
            rising = false;
            crossed |= slope < 0.0 && backbone.encloses(self.asked);
            // What the constant drive would change in a leg, and in all; and by how much it relaxes in a leg.
            let rate = self.gain() * SHORTEST * self.period;
            let changes = (rate * missing.abs()).min(missing.abs() / slope.abs());
            let error = missing.abs().max(LATE * seen.unsteady.abs());
            let tolerance = self.tolerance(slope, &seen);
            let firm = slope > FIRM * self.linear.damping_rate / self.gain();
            if !firm && error < (HELD * tolerance).max(seen.noise) {
                return Ok(Found::Held);
            }
            legs += u32::from(missing.abs() < NEARLY * self.asked);
            let settles = rate * slope > 0.5 || legs > PATIENCE;
            if slope > 0.0 && (firm && error < tolerance || changes < largest && settles) {
                if self.hand_over()? {
                    return Ok(Found::Locked);
                }
                seen = self.leg(self.setpoint, SHORTEST, 0.0)?;
                seen = self.fall(seen, slower, LOST * seen.response)?;
                if !seen.symmetric {
                    return Ok(Found::Lost { last: seen, crossed });
                }
                (upwards, exceeded) = (false, false);
            }
        }
    }

    /// Hands over to the constant drive. Returns whether the motion has locked there; if not, it has lost its symmetry.
    fn hand_over(&mut self) -> Result<bool, ExperimentError> {
        self.bench.controller.hold_drive()?;
        let (mut other, mut before) = (0, f64::INFINITY);
        while other < 2 {
            let seen = self.measure(SHORTEST)?;
            // Beside symmetry breaking the symmetry is lost slowly.
            if self.last.settled && seen.asymmetry <= before.max(STILL) {
                return Ok(true);
            }
            before = seen.asymmetry;
            other = if seen.symmetric { 0 } else { other + 1 };
            self.setpoint = seen.last;
        }
        Ok(false)
    }

    /// A leg of a sweep: changes the response by `change`, m, and lets it go on at this rate.
    fn sweep(&mut self, seen: &Leg, change: f64, slower: f64) -> Result<Leg, ExperimentError> {
        let periods = self.periods(slower * change, seen.holding).max(SHORTEST).ceil();
        self.leg(self.setpoint + change, periods, change / (periods * self.period))
    }

    /// Moves the setpoint to `to`, m, in so many periods, with the growth `onward`, m/s, at the end and after it. Measures meanwhile.
    fn leg(&mut self, to: f64, periods: f64, onward: f64) -> Result<Leg, ExperimentError> {
        let to = Move {
            response: to.max(LOWEST * self.b),
            duration: periods * self.period,
            growth: onward,
            ..Move::default()
        };
        self.bench.controller.hold_response(to, self.target)?;
        self.setpoint = to.response;
        self.measure(periods)
    }

    /// Measures until late impacts falsify the holding drive by little, compared with its distance from the requested one.
    fn hold(&mut self, slope: f64) -> Result<Leg, ExperimentError> {
        let mut seen = self.measure(SHORTEST)?;
        for _ in 0..LONGEST {
            let missing = (seen.holding - self.asked).abs();
            let allowed = (0.1 * missing).max(self.tolerance(slope, &seen));
            if LATE * seen.unsteady.abs() < allowed || !seen.symmetric {
                break;
            }
            seen = self.measure(SHORTEST)?;
        }
        Ok(seen)
    }

    /// Largest error of the holding drive, m, at the end: as much as changes the response by the same share, or what noise hides.
    fn tolerance(&self, slope: f64, seen: &Leg) -> f64 {
        (ARRIVED * (slope.abs() * seen.response).clamp(FIRM * self.asked, self.asked)).max(SIGNIFICANT * seen.noise)
    }

    /// Periods for a change of the response by `change`, m, against the holding drive, m.
    fn periods(&self, change: f64, holding: f64) -> f64 {
        let rate = SHARE * self.gain() * holding.max(FIRM * self.asked);
        change.abs() / (rate * self.period)
    }

    /// Growth rate of the response per drive, 1/s, at the natural frequency.
    fn gain(&self) -> f64 {
        0.5 * self.linear.omega0
    }

    /// Measures over so many periods, or until the lock has settled.
    fn measure(&mut self, periods: f64) -> Result<Leg, ExperimentError> {
        let (mut all, mut begins): (Vec<Period>, Vec<_>) = (Vec::new(), Vec::new());
        while (all.len() as f64) < periods && !(self.last.settled && all.len() > 3) {
            begins.push((self.bench.samples.len(), self.bench.periods));
            all.extend(self.one_period()?);
        }
        // Where a foreign tone was read, the periods are measured again without it.
        let from = begins[0]
            .0
            .saturating_sub(self.scene.controller.samples_per_period as usize);
        let omega = mean(all.iter().map(|one| one.cycle.omega));
        if let Some(samples) = without_tones(&self.bench.samples[from..], self.scene, omega) {
            let ends = begins[1..].iter().map(|next| next.0 - from).chain([samples.len()]);
            let again = begins.iter().zip(ends).filter_map(|(&(begin, turns), end)| {
                let step = self.bench.sample_time;
                Period::of(&samples[..end], begin - from, step, turns * TAU, self.target)
            });
            all = again.collect();
        }
        let (first, last) = (&all[0], &all[all.len() - 1]);
        let duration = last.cycle.time - first.cycle.time;
        let omega = mean(all.iter().map(|one| one.cycle.omega));
        let gain = self.gain() * self.linear.omega0 / omega;
        // The slope of the straight line through the amplitudes weighs their changes by a parabola; so is all else.
        let n = all.len() as f64;
        let weights = (1..all.len()).map(|i| 6.0 * i as f64 * (n - i as f64) / (n * (n * n - 1.0)));
        let weighted = |value: &dyn Fn(&Period, &Period) -> f64| -> f64 {
            let values = all.windows(2).map(|pair| value(&pair[0], &pair[1]));
            weights.clone().zip(values).map(|(weight, value)| weight * value).sum()
        };
        let response = weighted(&|one, next| 0.5 * (one.amplitude + next.amplitude));
        let work = weighted(&|one, next| 0.5 * (one.work + next.work));
        let pace = gain * duration / (n - 1.0);
        let unsteady = weighted(&|one, next| next.amplitude - one.amplitude) / pace;
        let holding = work - unsteady;
        let scatter = mean(all.iter().map(|one| one.noise)).sqrt();
        // Its phase turns with that of the drive, and by the change of the difference.
        let turned: f64 = all.windows(2).map(|pair| turned(&pair[0], &pair[1])).sum();
        let beside = gain * mean(all.iter().map(|one| one.work * one.cycle.phase_error.tan())) / response;
        let detuned = turned / duration + beside - self.linear.omega0;
        let linear = self.linear.damping_rate / gain * response;
        let departure = (holding - linear).hypot(response * detuned / gain);
        // Noise gives either harmonic of two periods the mean square scatter^2, which itself scatters by a share of sqrt(2/n).
        let [even, odd] = [0, 1].map(|k| mean(all.iter().map(|one| one.harmonics[k])) - scatter * scatter);
        let doubtful = SIGNIFICANT * scatter * scatter / (0.5 * n).sqrt();
        let departed = departure > DEPARTURE * linear.max(work);
        let symmetric = departed && even <= (SYMMETRIC * SYMMETRIC * odd).max(doubtful);
        if symmetric {
            let point = [response, holding];
            let [least, most] = self.extremes.unwrap_or([point, point]);
            let least = if holding < least[1] { point } else { least };
            self.extremes = Some([least, if holding > most[1] { point } else { most }]);
        }
        Ok(Leg {
            response,
            last: last.amplitude,
            holding,
            noise: (12.0 / (n * (n * n - 1.0))).sqrt() * scatter / pace,
            unsteady,
            departed,
            symmetric,
            asymmetry: ((even - doubtful).max(0.0) / odd).sqrt(),
        })
    }

    /// One period of the drive; `None` without a motion.
    fn one_period(&mut self) -> Result<Option<Period>, ExperimentError> {
        let begin = self.bench.samples.len();
        let first = self.bench.periods;
        while self.bench.periods < first.floor() + 1.0 {
            self.last = self.bench.sample(Stage::Locking)?;
            (self.progress)(self.bench.taken);
            if self.bench.taken >= self.limit {
                return Err(self.bench.no_lock(&self.last));
            }
        }
        Ok(Period::of(
            self.bench.samples,
            begin,
            self.bench.sample_time,
            first * TAU,
            self.target,
        ))
    }

    /// Why the requested drive was not reached.
    fn not_reached(&self) -> ExperimentError {
        let d = self.scene.dimensionless();
        let why = match self.extremes {
            None => format!(
                "no symmetric 1:1 motion was found at responses up to C = {:.3}",
                self.setpoint / self.b
            ),
            Some(extremes) => {
                let [least, most] =
                    extremes.map(|[c, g]| format!("G = {:.4} (C = {:.4})", d.excitation(g), c / self.b));
                format!(
                    "the symmetric 1:1 motions that were found need from {least} to {most}, and were lost {SEARCHES} times on the way"
                )
            }
        };
        ExperimentError::NotReached { periods: self.bench.periods, g: d.g, why }
    }
}

/// Phase, rad, by which the response turns from the middle of a period to that of another.
fn turned(before: &Period, after: &Period) -> f64 {
    let drive = after.cycle.drive_phase - before.cycle.drive_phase;
    let more = after.phase - before.phase;
    drive + (more + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU
}

impl Period {
    /// The last of these samples, from `begin` on; `phase` (rad) is that of the drive there, `target` (rad) that of the response.
    fn of(samples: &[Sample], begin: usize, sample_time: f64, phase: f64, target: f64) -> Option<Self> {
        let cycle = Cycle::of(&samples[begin..], sample_time, phase, target)?;
        let drive = mean(samples[begin..].iter().map(|one| one.command.drive.amplitude));
        // Two periods tell the harmonics from a drift of the fundamental.
        let samples = &samples[(2 * begin).saturating_sub(samples.len())..];
        let phases: Vec<f64> = (0..samples.len())
            .map(|n| n as f64 * sample_time * cycle.omega)
            .collect();
        let basis = HarmonicBasis::new(&phases, 0, &[Some(1), Some(0), Some(0), Some(0), Some(0)]);
        let values = DVector::from_iterator(samples.len(), samples.iter().map(|one| one.sensors.response));
        let fit = basis.fit(&values)?;
        let rest = noise(basis.residual(&values, &fit).as_slice());
        Some(Self {
            amplitude: cycle.amplitude(),
            phase: cycle.response[0].arg(),
            work: drive * cycle.phase_error.cos(),
            harmonics: [2, 3].map(|n| fit.harmonic(n).norm_sqr()),
            noise: rest * rest * 2.0 / cycle.samples as f64,
            cycle,
        })
    }
}

/// The measured backbone: the present point, and the last ones that tell its slope, the latest first.
#[derive(Default)]
struct Backbone {
    present: Option<Leg>,
    points: Vec<Leg>,
}

impl Backbone {
    fn add(&mut self, seen: Leg) {
        self.present = Some(seen);
        let tells = |point: &Leg| {
            let noise = SIGNIFICANT * point.noise.hypot(seen.noise);
            let late = (LATE * (point.unsteady - seen.unsteady).abs()).max(noise);
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
        let present = self.present.as_ref()?;
        let is_latest = present.response == one.response;
        let share = 1.0
            + if is_latest {
                (drive - two.holding) * bend / slope
            } else {
                0.0
            };
        Some(present.response + (drive - present.holding) * slope * share.clamp(0.25, 1.5))
    }
}
