//! Periodic motions of the plant itself, with all effects of its cavity: Newton's method on the plant's own period map.
//!
//! The unknowns are the state at a section, the frequency and the amplitude of the base; the equations are the four that close the motion and
//! two [`DriveCondition`]s. The plant's map and its derivative ([`Variation`]) are closed forms between events, exact to rounding.
//! The section is the middle of the longest flight. Events stay away from it, and all four coordinates are free there, also where the particle
//! sticks later: the map then loses rank, but the map minus the identity does not.
//!
//! The first harmonic of the particle is integrated by Gauss's rule from event to event, where the motion is analytic. With it, the balance of
//! momentum gives the harmonic of the primary mass: `(k - M omega² + i c omega) Q1 = (k + i c omega) E + m omega² Q2`.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::cavity::Rebound;
use lovines::{Cavity, Drive, Event, InvalidValue, Outcome, Parameters, Plant, Restitution, State, Variation, Wall};
use nalgebra::{Complex, Matrix6, SMatrix, Vector4, Vector6};
use thiserror::Error;

use super::Orbit;
use super::periodic::SETTLING_DISTANCE;
use super::return_map::plant_at;
use super::stability;
use super::study::{at_amplitude, at_speed, stable_resonant};
use crate::numerics::{Equations, newton};
use crate::theory::{B_SYMMETRY_BREAKING, Manifold};
use crate::{Definition, Dimensionless, Sensor};

/// A periodic motion of the plant, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantMotion {
    /// The state where the phase of the base is 0.
    pub state: State,
    /// Angular frequency of the base, rad/s.
    pub omega: f64,
    /// Amplitude of the base, m.
    pub amplitude: f64,
    /// Periods of the base until the motion repeats.
    pub periods: u32,
    /// First harmonic S of the response relative to the reference, m: the response has the part `Im(S exp(i phase))`.
    pub response: Complex<f64>,
    /// Floquet multipliers over the whole motion, by rising modulus.
    pub multipliers: [Complex<f64>; 4],
    /// Impacts over the whole motion.
    pub impacts: usize,
    /// How often the particle comes to rest on a wall, over the whole motion.
    pub rests: usize,
    /// How often it sticks to the floor inside the cavity, over the whole motion.
    pub sticks: usize,
    /// All events with the phase of the base, rad, from 0 to 2 pi times `periods`.
    pub events: Vec<(f64, Event)>,
}

impl PlantMotion {
    /// Whether all multipliers are inside the unit circle.
    pub fn is_stable(&self) -> bool {
        stability(self.growth())[0]
    }

    /// Whether the largest multipliers are on the unit circle, within 1e-7: disturbances neither grow nor decay.
    pub fn is_neutral(&self) -> bool {
        stability(self.growth())[1]
    }

    /// Modulus of the largest multiplier.
    fn growth(&self) -> f64 {
        self.multipliers[3].norm()
    }
}

/// An equation for the drive of a periodic motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveCondition {
    /// The angular frequency, rad/s.
    Omega(f64),
    /// The amplitude of the base, m.
    Amplitude(f64),
    /// The first harmonic of the response has the phase of the definition relative to the reference: at phase resonance it lags by a quarter of a period.
    PhaseResonance,
    /// The part of the response's first harmonic that has this phase, m.
    Response(f64),
    /// Response and frequency lie on a line: the place of a curve that crosses it, also where amplitude or frequency have an extremum.
    Across {
        /// Amplitude of the response, m, and angular frequency, rad/s, of a point of the line.
        at: [f64; 2],
        /// The normal of the line, over b and over epsilon omega0.
        normal: [f64; 2],
    },
}

/// Why no periodic motion was found.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum NoMotion {
    #[error(transparent)]
    Invalid(#[from] InvalidValue),
    #[error("with a scatter of the restitution, here {0}, no motion is periodic: set it to 0 (r_scatter in a scene)")]
    Scatter(f64),
    #[error("the ideal cavity has no symmetric 1:1 motion at resonance with a response of {0} m, from which to start")]
    NoIdealMotion(f64),
    #[error(
        "the ideal cavity has no stable symmetric 1:1 motion at resonance under a base of {0} m, from which to start"
    )]
    NoIdealMotionUnder(f64),
    #[error("Newton's method finds no periodic motion near its start")]
    NotConverged,
    #[error("the resonant motion of the ideal cavity is lost when {} % of the cavity's effects act", 100.0 * .0)]
    Lost(f64),
}

/// The motion at phase resonance whose response has the amplitude `response`, m: near `guess` or, without one, continued from the exact
/// symmetric motion of the ideal cavity while its effects grow to their strength.
///
/// Mostly the ideal motion with the same response serves. Near its bifurcations it may be lost, or lead to an unstable motion beside the one that the
/// ideal motion becomes: then the effects also grow where it is most stable, in the middle of its range, and the response changes afterwards, not
/// beyond a fold. Of both motions the more stable one counts.
///
/// # Errors
/// Invalid parameters, a scatter of the restitution, and where no motion is found.
pub fn resonant_motion(
    parameters: &Parameters,
    definition: Definition,
    response: f64,
    guess: Option<&PlantMotion>,
) -> Result<PlantMotion, NoMotion> {
    let conditions = [DriveCondition::PhaseResonance, DriveCondition::Response(response)];
    // Refuses what cannot be solved before anything is computed.
    Solver::new(parameters, definition, 1, conditions)?;
    let near_guess = guess.map(|guess| periodic_motion(parameters, definition, guess, conditions));
    if let Some(result) = near_guess.filter(|result| *result != Err(NoMotion::NotConverged)) {
        return result;
    }
    let of_response = |scene: &Dimensionless| at_amplitude(scene, response / scene.b);
    // In the middle of the speeds B where the first-order motion is stable.
    let in_the_middle =
        |scene: &Dimensionless| at_speed(scene, 0.5 * (Manifold::new(scene.r).b_min() + B_SYMMETRY_BREAKING));
    let ideal = Ideal::of(parameters, definition, of_response).ok_or(NoMotion::NoIdealMotion(response))?;
    let motion = Ideal { response, ..ideal }.continued(parameters, definition, Some(response));
    if motion.as_ref().is_ok_and(PlantMotion::is_stable) {
        return motion;
    }
    let detour = Ideal::of(parameters, definition, in_the_middle)
        .map(|ideal| ideal.continued(parameters, definition, Some(response)));
    match detour {
        Some(Ok(again)) if motion.as_ref().is_ok_and(|motion| motion.growth() <= again.growth()) => motion,
        Some(Ok(again)) => Ok(again),
        _ => motion,
    }
}

/// The motion near `guess` that satisfies both conditions; of `guess`, only state, drive and number of periods matter.
pub fn periodic_motion(
    parameters: &Parameters,
    definition: Definition,
    guess: &PlantMotion,
    conditions: [DriveCondition; 2],
) -> Result<PlantMotion, NoMotion> {
    let PlantMotion { state, omega, amplitude, periods, .. } = *guess;
    let mut solver = Solver::new(parameters, definition, periods, conditions)?;
    let start = unknowns(&solver.scale, &state, omega, amplitude);
    Ok(solver.solve(0.0, start)?.motion)
}

/// The motion at phase resonance under a base of the amplitude `amplitude`, m, continued from the stable symmetric motion of the ideal cavity
/// with the smallest response.
pub fn resonant_motion_under(
    parameters: &Parameters,
    definition: Definition,
    amplitude: f64,
) -> Result<PlantMotion, NoMotion> {
    let conditions = [DriveCondition::PhaseResonance, DriveCondition::Amplitude(amplitude)];
    Solver::new(parameters, definition, 1, conditions)?;
    let motion = |scene: &Dimensionless| stable_resonant(&Dimensionless { g: scene.excitation(amplitude), ..*scene });
    let ideal = Ideal::of(parameters, definition, motion).ok_or(NoMotion::NoIdealMotionUnder(amplitude))?;
    Ideal { amplitude, ..ideal }.continued(parameters, definition, None)
}

/// Rounding error of a multiplier that is 1.
const NEUTRAL: f64 = 1e-9;
/// Longest motion that is searched, periods of the base.
const LONGEST_MOTION: u32 = 32;

/// The motion that a state at phase 0 of the base leads to under a drive within `settle` periods; `None` if it does not repeat within 32.
pub fn settled_motion(
    parameters: &Parameters,
    definition: Definition,
    [omega, amplitude]: [f64; 2],
    start: State,
    settle: usize,
) -> Result<Option<PlantMotion>, NoMotion> {
    let conditions = [DriveCondition::Omega(omega), DriveCondition::Amplitude(amplitude)];
    Solver::new(parameters, definition, 1, conditions)?;
    let (mut plant, drive) = (Plant::new(*parameters, start)?, Drive::harmonic(amplitude, omega));
    plant.begin(drive)?;
    plant.advance(drive, settle as f64 * TAU / omega)?;
    let scale = scale(parameters);
    let here = unknowns(&scale, &plant.state(), omega, amplitude);
    for periods in 1..=LONGEST_MOTION {
        plant.advance(drive, TAU / omega)?;
        let apart = (unknowns(&scale, &plant.state(), omega, amplitude) - here).amax();
        if apart < SETTLING_DISTANCE {
            match Solver::new(parameters, definition, periods, conditions)?.solve(0.0, here) {
                // A particle that only slides may slide anywhere: one multiplier is 1.
                Ok(Solution { motion, .. }) if motion.growth() < 1.0 + NEUTRAL => return Ok(Some(motion)),
                Ok(_) | Err(NoMotion::NotConverged) => {}
                Err(error) => return Err(error),
            }
        }
    }
    Ok(None)
}

// Continuation from the ideal cavity

/// The ideal cavity that is nearest to a real one: the mean gap, and the restitution of both walls at the speed of the impacts.
///
/// Unequal gaps shift the particle by the middle of the cavity, and change nothing else.
struct Ideal {
    /// Speed of the impacts, m/s.
    speed: f64,
    restitution: f64,
    /// Amplitude of the response, m.
    response: f64,
    /// Phase of the base at the state after an impact on w = +b, angular frequency and amplitude of the base.
    phase: f64,
    state: State,
    omega: f64,
    amplitude: f64,
}

/// Rounds in which speed of the impacts and coefficient of restitution, which depend on each other, are found. A remainder is a worse start.
const SPEED_ROUNDS: usize = 8;

impl Ideal {
    /// Of the motion that `motion` gives of the scene with the ideal cavity.
    fn of(p: &Parameters, definition: Definition, motion: impl Fn(&Dimensionless) -> Option<Orbit>) -> Option<Self> {
        let [plus, minus] = p.gaps();
        let [half_width, middle] = [0.5 * (plus + minus), 0.5 * (plus - minus)];
        let rebound = Rebound::new(p);
        let mut speed = half_width * p.natural_frequency();
        let mut ideal = None;
        for _ in 0..SPEED_ROUNDS {
            let [plus, minus] = Wall::BOTH.map(|wall| rebound.mean(wall, speed));
            let restitution = 0.5 * (plus + minus);
            let plant = Parameters { half_width, restitution, ..*p };
            let scene = Dimensionless { definition, ..Dimensionless::of(&plant, 0.0) };
            let motion = motion(&scene)?;
            let (unit, rate, before) = (half_width, half_width * scene.omega0, speed);
            speed = motion.impact_velocity * rate;
            let start = motion.start;
            ideal = Some(Self {
                speed,
                restitution,
                response: motion.c * unit,
                phase: start.phase,
                state: State {
                    q1: start.q1 * unit,
                    dq1: start.dq1 * rate,
                    q2: start.q2 * unit - middle,
                    dq2: start.dq2 * rate,
                },
                omega: motion.omega * scene.omega0,
                amplitude: scene.amplitude(motion.g),
            });
            if speed == before {
                break;
            }
        }
        ideal
    }

    /// The motion at phase resonance with all effects under the drive of the ideal motion or, if `response` is given, with this response, m.
    fn continued(
        &self,
        p: &Parameters,
        definition: Definition,
        response: Option<f64>,
    ) -> Result<PlantMotion, NoMotion> {
        let (mut phase, mut at) = (self.phase, unknowns(&scale(p), &self.state, self.omega, self.amplitude));
        // Up to 1 the effects grow, from 1 to 2 the response changes.
        let end = if response.is_none_or(|response| response == self.response) {
            1.0
        } else {
            2.0
        };
        let (mut done, mut increase, mut side) = (0.0, 1.0, None);
        loop {
            let next = f64::min(done + increase, if done < 1.0 { 1.0 } else { end });
            let partial = self.with_effects(p, next.min(1.0));
            let second = match response {
                Some(end) => DriveCondition::Response(self.response + (next - 1.0).max(0.0) * (end - self.response)),
                None => DriveCondition::Amplitude(self.amplitude),
            };
            let conditions = [DriveCondition::PhaseResonance, second];
            let found = Solver::new(&partial, definition, 1, conditions)?.solve(phase, at);
            let is_beyond_fold = |found: &Solution| side.is_some_and(|side| side != found.side);
            match found {
                // A particle that only rests is another motion: a linear one.
                Ok(Solution { motion, .. }) if motion.impacts == 0 => return Err(NoMotion::Lost(next.min(1.0))),
                Ok(found) if !is_beyond_fold(&found) => {
                    if next == end {
                        return Ok(found.motion);
                    }
                    (done, phase, at, increase) = (next, found.phase, found.at, 2.0 * increase);
                    side = (done >= 1.0).then_some(found.side);
                }
                Ok(_) | Err(NoMotion::NotConverged) if increase > SMALLEST_INCREASE => increase *= 0.5,
                Err(NoMotion::NotConverged) if next <= 1.0 => return Err(NoMotion::Lost(next)),
                Ok(_) => return Err(NoMotion::NotConverged),
                Err(error) => return Err(error),
            }
        }
    }

    /// The rig with a share of the effects of its cavity.
    fn with_effects(&self, p: &Parameters, share: f64) -> Parameters {
        let r = self.restitution;
        let between = |from: f64, to: f64| from + share * (to - from);
        let restitution = p.cavity.restitution.map(|law| {
            Some(match law.unwrap_or(Restitution::Constant(p.restitution)) {
                Restitution::Constant(to) => Restitution::Constant(between(r, to)),
                Restitution::Viscoelastic(to) => {
                    Restitution::Viscoelastic(between((1.0 - r) / self.speed.powf(0.2), to))
                }
                Restitution::Plastic(to) => Restitution::Plastic(between((self.speed * r.powi(4)).ln(), to.ln()).exp()),
            })
        });
        let cavity = Cavity {
            tilt: share * p.cavity.tilt,
            kinetic_friction: share * p.cavity.kinetic_friction,
            static_friction: p.cavity.static_friction.map(|held| share * held),
            restitution: if share == 1.0 {
                p.cavity.restitution
            } else {
                restitution
            },
            ..p.cavity
        };
        Parameters { cavity, ..*p }
    }
}

/// Smallest increase, of the strength of the effects or of the response towards its value, before the motion counts as lost.
const SMALLEST_INCREASE: f64 = 1.0 / 64.0;

// Newton's method

/// The unknowns over their scales: (q1, q1', q2, q2') at the section, frequency, amplitude of the base.
type Unknowns = Vector6<f64>;

/// The scales: b, b omega0, and what a change of sigma or G by 1 is.
fn scale(p: &Parameters) -> Unknowns {
    let [plus, minus] = p.gaps();
    let (length, omega0, epsilon) = (0.5 * (plus + minus), p.natural_frequency(), p.mass_ratio());
    let speed = length * omega0;
    Unknowns::from([length, speed, length, speed, epsilon * omega0, epsilon * length])
}

fn unknowns(scale: &Unknowns, state: &State, omega: f64, amplitude: f64) -> Unknowns {
    let State { q1, dq1, q2, dq2 } = *state;
    Unknowns::from([q1, dq1, q2, dq2, omega, amplitude]).component_div(scale)
}

/// A plant at the section, its drive, and the duration of the motion, s.
type Start = (Plant, Drive, f64);

/// A solution, with phase and unknowns at its section.
struct Solution {
    motion: PlantMotion,
    phase: f64,
    at: Unknowns,
    /// Sign of the determinant of the equations: independent of the section, it changes where a curve of motions folds.
    side: f64,
}

struct Solver<'a> {
    parameters: &'a Parameters,
    definition: Definition,
    conditions: [DriveCondition; 2],
    periods: u32,
    scale: Unknowns,
    /// Phase of the base at the section, rad.
    phase: f64,
    events: Vec<Event>,
}

impl<'a> Solver<'a> {
    fn new(
        parameters: &'a Parameters,
        definition: Definition,
        periods: u32,
        conditions: [DriveCondition; 2],
    ) -> Result<Self, NoMotion> {
        parameters.validate()?;
        if parameters.cavity.scatter > 0.0 {
            return Err(NoMotion::Scatter(parameters.cavity.scatter));
        }
        Ok(Self {
            parameters,
            definition,
            conditions,
            periods,
            scale: scale(parameters),
            phase: 0.0,
            events: Vec::new(),
        })
    }

    /// The plant at the section in the state and under the drive of `x`.
    fn start(&self, x: &Unknowns) -> Option<Start> {
        let [q1, dq1, q2, dq2, omega, amplitude] = x.component_mul(&self.scale).into();
        if !(omega > 0.0 && omega.is_finite()) {
            return None;
        }
        let (drive, state) = (Drive::harmonic(amplitude, omega), State { q1, dq1, q2, dq2 });
        let plant = plant_at(self.parameters, state, drive, self.phase)?;
        Some((plant, drive, TAU * f64::from(self.periods) / omega))
    }

    /// The state after the motion. The events are kept.
    fn follow(&mut self, (mut plant, drive, duration): Start) -> Option<State> {
        let events = &mut self.events;
        events.clear();
        let Outcome { cut_short, .. } = plant.advance_with(drive, duration, |event| events.push(event)).ok()?;
        (!cut_short).then(|| plant.state())
    }

    /// The motion from the unknowns `x`, with its derivatives.
    fn turn(&mut self, x: &Unknowns) -> Option<Turn> {
        let start = self.start(x)?;
        let end = self.follow(start)?;
        let (plant, Drive { omega, .. }, duration) = start;
        let mut variation = Variation::of(&plant);
        let mut harmonic = ParticleHarmonic {
            omega,
            sum: Complex::new(0.0, 0.0),
            by: [Complex::new(0.0, 0.0); 6],
        };
        for event in &self.events {
            harmonic.add(&variation, event.time() - variation.elapsed());
            variation.pass(event, 0.0);
        }
        let rest = (duration - variation.elapsed()).max(0.0);
        harmonic.add(&variation, rest);
        variation.advance(rest);

        // The duration depends on the frequency.
        let (rates, shorter) = (variation.rates(), -duration / omega);
        let mut by = SMatrix::<f64, 6, 4>::from(*variation.derivatives()).transpose();
        for row in 0..4 {
            by[(row, 4)] += rates[row] * shorter;
        }
        harmonic.by[4] += Complex::from_polar(end.q2, -omega * duration) * shorter;
        let (response, response_by) = self.response(x, duration, &harmonic);
        let scale = &self.scale;
        let by = SMatrix::<f64, 4, 6>::from_fn(|row, column| by[(row, column)] * scale[column] / scale[row]);
        Some(Turn {
            apart: unknowns(&self.scale, &end, 0.0, 0.0).fixed_rows::<4>(0) - x.fixed_rows::<4>(0),
            by,
            response,
            response_by: std::array::from_fn(|n| response_by[n] * (scale[n] / scale[0])),
        })
    }

    /// First harmonic of the response relative to the reference, m, and its derivatives by the state, the frequency and the amplitude.
    fn response(&self, x: &Unknowns, duration: f64, particle: &ParticleHarmonic) -> (Complex<f64>, [Complex<f64>; 6]) {
        let [omega, amplitude] = [4, 5].map(|n| x[n] * self.scale[n]);
        // q2 = Im(Q2 exp(i phase)) makes the integral of q2 exp(-i phase) equal to -i Q2/2 times the duration.
        let factor = Complex::from_polar(2.0 / duration, FRAC_PI_2 - self.phase);
        let q2 = particle.sum * factor;
        let mut q2_by = particle.by.map(|by| by * factor);
        q2_by[4] += q2 / omega;

        let p = self.parameters;
        let inertia = p.particle_mass * omega * omega;
        let base = Complex::new(p.stiffness, p.damping * omega);
        let stiffness = base - p.primary_mass * omega * omega;
        let q1 = (base * amplitude + q2 * inertia) / stiffness;
        let mut q1_by = q2_by.map(|by| by * inertia / stiffness);
        let base_by = Complex::new(0.0, p.damping);
        let stiffness_by = base_by - 2.0 * p.primary_mass * omega;
        q1_by[4] += (base_by * amplitude + q2 * (2.0 * inertia / omega) - q1 * stiffness_by) / stiffness;
        q1_by[5] += base / stiffness;

        let omega0 = p.natural_frequency();
        let over_omega0 = omega / omega0;
        let of_particle = match self.definition.sensor {
            Sensor::V => p.mass_ratio(),
            Sensor::Q1 => 0.0,
        };
        let damping = p.damping / (p.primary_mass * omega0);
        let reference = self.definition.reference;
        let turned = Complex::from_polar(1.0, -reference.phase(damping, over_omega0));
        let read = |q1: Complex<f64>, q2: Complex<f64>| (q1 + q2 * of_particle) * turned;
        let response = read(q1, q2);
        let mut by: [_; 6] = std::array::from_fn(|n| read(q1_by[n], q2_by[n]));
        by[4] -= response * Complex::i() * (reference.phase_slope(damping, over_omega0) / omega0);
        (response, by)
    }

    /// Moves the section to the middle of the longest flight of the motion from `x`; with `if_near`, only if it is much nearer to an event now.
    fn centre(&mut self, x: &mut Unknowns, if_near: bool) -> Option<()> {
        let start = self.start(x)?;
        self.follow(start)?;
        let (mut plant, drive, duration) = start;
        let times = self.events.iter().map(Event::time);
        let ends: Vec<f64> = [0.0].into_iter().chain(times).chain([duration]).collect();
        let [.., last, _] = ends[..] else { return None };
        let mut distance = if if_near {
            2.0 * ends[1].min(duration - last)
        } else {
            0.0
        };
        let (mut now, mut best) = (0.0, None);
        for pair in ends.windows(2) {
            let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
            plant.advance(drive, (middle - now).max(0.0)).ok()?;
            now = middle;
            let is_flight = plant.contact().is_none() && !plant.sticks();
            if is_flight && half > distance {
                distance = half;
                best = Some((middle, plant.state()));
            }
        }
        if let Some((t, state)) = best {
            let Drive { omega, amplitude, .. } = drive;
            self.phase = (self.phase + omega * t).rem_euclid(TAU);
            *x = unknowns(&self.scale, &state, omega, amplitude);
        }
        Some(())
    }

    /// The motion near the unknowns `x` at the phase `phase`.
    fn solve(&mut self, phase: f64, mut x: Unknowns) -> Result<Solution, NoMotion> {
        self.phase = phase.rem_euclid(TAU);
        let found = self.centre(&mut x, false).and_then(|()| newton(self, x));
        let at = found.ok_or(NoMotion::NotConverged)?;
        let (motion, jacobian) = self.motion(&at).zip(self.at(&at)).ok_or(NoMotion::NotConverged)?;
        let side = jacobian.1.determinant().signum();
        Ok(Solution { motion, phase: self.phase, at, side })
    }

    /// The motion at the solution `x`.
    fn motion(&mut self, x: &Unknowns) -> Option<PlantMotion> {
        let turn = self.turn(x)?;
        let mut multipliers: [Complex<f64>; 4] =
            turn.by.fixed_columns::<4>(0).into_owned().complex_eigenvalues().into();
        multipliers.sort_by(|first, second| first.norm().total_cmp(&second.norm()));
        let (mut plant, drive, duration) = self.start(x)?;
        let Drive { omega, amplitude, .. } = drive;
        // A particle at rest in the section has settled on its wall, without the residual of the solution, where the phase is 0.
        plant.advance(drive, (TAU - self.phase) / omega).ok()?;
        let state = plant.state();
        let mut events = Vec::new();
        let record = |event: Event| events.push((omega * event.time(), event));
        plant.advance_with(drive, duration, record).ok()?;
        let count = |is: fn(&Event) -> bool| events.iter().filter(|(_, event)| is(event)).count();
        Some(PlantMotion {
            state,
            omega,
            amplitude,
            periods: self.periods,
            response: turn.response,
            multipliers,
            impacts: count(|event| matches!(event, Event::Impact { .. })),
            rests: count(|event| matches!(event, Event::Stuck { .. })),
            sticks: count(|event| matches!(event, Event::Sticking { .. })),
            events,
        })
    }
}

/// A motion of the plant over its periods, with derivatives by the unknowns.
struct Turn {
    /// State at the end less the one at the start.
    apart: Vector4<f64>,
    /// Derivative of the state at the end.
    by: SMatrix<f64, 4, 6>,
    /// First harmonic of the response relative to the reference, m, and its derivatives over the scale of lengths.
    response: Complex<f64>,
    response_by: [Complex<f64>; 6],
}

impl Equations<6> for Solver<'_> {
    fn at(&mut self, x: &Unknowns) -> Option<(Unknowns, Matrix6<f64>)> {
        let turn = self.turn(x)?;
        // The phase of the definition becomes a lag of a quarter of a period.
        let turned = Complex::from_polar(1.0, -FRAC_PI_2 - self.definition.phase);
        let response = turn.response * turned / self.scale[0];
        let (mut residual, mut jacobian) = (Unknowns::zeros(), Matrix6::zeros());
        residual.fixed_rows_mut::<4>(0).copy_from(&turn.apart);
        let closing = turn.by - SMatrix::<f64, 4, 6>::identity();
        jacobian.fixed_rows_mut::<4>(0).copy_from(&closing);
        let unit = |n: usize| Unknowns::from_fn(|column, _| f64::from(u8::from(column == n)));
        let [in_phase, lagging] = [|z: &Complex<f64>| z.re, |z: &Complex<f64>| z.im]
            .map(|part| Unknowns::from(turn.response_by.map(|by| part(&(by * turned)))));
        for (row, condition) in [4, 5].into_iter().zip(self.conditions) {
            let (value, by) = match condition {
                DriveCondition::Omega(omega) => (x[4] - omega / self.scale[4], unit(4)),
                DriveCondition::Amplitude(amplitude) => (x[5] - amplitude / self.scale[5], unit(5)),
                DriveCondition::PhaseResonance => (response.re, in_phase),
                DriveCondition::Response(amplitude) => (response.im + amplitude / self.scale[0], lagging),
                DriveCondition::Across { at: [amplitude, omega], normal } => (
                    normal[0] * (response.im + amplitude / self.scale[0]) - normal[1] * (x[4] - omega / self.scale[4]),
                    lagging * normal[0] - unit(4) * normal[1],
                ),
            };
            residual[row] = value;
            jacobian.set_row(row, &by.transpose());
        }
        let is_finite = residual.iter().chain(&jacobian).all(|value| value.is_finite());
        is_finite.then_some((residual, jacobian))
    }

    fn restarted(&mut self, x: &Unknowns) -> Option<Unknowns> {
        let (before, mut x) = (self.phase, *x);
        self.centre(&mut x, true)?;
        (self.phase != before).then_some(x)
    }
}

/// The integral of `q2 exp(-i omega t)` over a motion, by Gauss's rule from event to event, and its derivatives.
struct ParticleHarmonic {
    omega: f64,
    sum: Complex<f64>,
    by: [Complex<f64>; 6],
}

impl ParticleHarmonic {
    /// Adds a stretch without events, s, from where the motion is.
    fn add(&mut self, from: &Variation, duration: f64) {
        let pieces = (self.omega * duration / PI).ceil().max(1.0);
        let half = 0.5 * duration / pieces;
        let (start, rates, by) = (from.state(), from.rates(), from.derivatives());
        for piece in 0..pieces as usize {
            for (node, weight) in gauss() {
                let t = half * ((2 * piece + 1) as f64 + node);
                let (q2, q2_by) = if from.is_flight() {
                    let q2 = start.q2 + t * (start.dq2 + 0.5 * rates[3] * t);
                    (q2, std::array::from_fn(|n| by[2][n] + t * by[3][n]))
                } else {
                    let mut at = *from;
                    at.advance(t);
                    (at.state().q2, at.derivatives()[2])
                };
                let since = from.elapsed() + t;
                let turned = Complex::from_polar(weight * half, -self.omega * since);
                self.sum += turned * q2;
                for (sum, by) in self.by.iter_mut().zip(q2_by) {
                    *sum += turned * by;
                }
                self.by[4] += turned * Complex::new(0.0, -since * q2);
            }
        }
    }
}

/// Nodes and weights of Gauss's rule with ten points on [-1, 1], by rising node.
fn gauss() -> impl Iterator<Item = (f64, f64)> {
    const NODES: [(f64, f64); 5] = [
        (0.148_874_338_981_631_22, 0.295_524_224_714_752_87),
        (0.433_395_394_129_247_2, 0.269_266_719_309_996_35),
        (0.679_409_568_299_024_4, 0.219_086_362_515_982_04),
        (0.865_063_366_688_984_5, 0.149_451_349_150_580_6),
        (0.973_906_528_517_171_7, 0.066_671_344_308_688_14),
    ];
    let below = NODES.into_iter().rev().map(|(node, weight)| (-node, weight));
    below.chain(NODES)
}
