//! Periodic motions of the plant itself, with all effects of its cavity: Newton's method on the plant's own period map.
//!
//! The unknowns are the state at a section, the frequency and the amplitude of the base; the equations are the four that close the motion and
//! two [`DriveCondition`]s. All derivatives are differences: between events the plant is a closed form, so its map is exact to rounding.
//! The section is the middle of the longest flight. Events stay away from it, and all four coordinates are free there, also where the particle
//! sticks later: the map then loses rank, but the map minus the identity does not.
//!
//! The first harmonic of the particle is integrated by Gauss's rule from event to event, where the motion is analytic. With it, the balance of
//! momentum gives the harmonic of the primary mass: `(k - M omega² + i c omega) Q1 = (k + i c omega) E + m omega² Q2`.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::cavity::Rebound;
use lovines::{Cavity, Drive, Event, InvalidValue, Outcome, Parameters, Plant, Restitution, State, Wall};
use nalgebra::{Complex, Matrix4, Matrix6, Vector4, Vector6};
use thiserror::Error;

use super::Orbit;
use super::periodic::NEAR;
use super::symmetric::{at_amplitude, at_speed, stable_resonant};
use crate::theory::{B_SYMMETRY_BREAKING, Manifold};
use crate::{Definition, Dimensionless, Resonance, Sensor};

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
    /// First harmonic S of the response relative to the reference, m: the response has the part `Im(S exp(i phase))`. Accelerations are over
    /// omega0².
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
        self.multipliers[3].norm() < 1.0
    }
}

/// An equation for the drive of a periodic motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveCondition {
    /// The angular frequency, rad/s.
    Omega(f64),
    /// The amplitude of the base, m.
    Amplitude(f64),
    /// The first harmonic of the response lags the reference by a quarter of a period.
    PhaseResonance,
    /// The part of the response's first harmonic that lags the reference by a quarter of a period, m.
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
    #[error(
        "periodic motions with effects of the cavity are found at phase resonance, not at the peak of the response"
    )]
    Peak,
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
/// ideal motion becomes: then the effects grow where it is most stable, in the middle of its range, and the response changes afterwards.
///
/// # Errors
/// Invalid parameters, a scatter of the restitution, the peak as resonance, and where no motion is found.
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
        Some(Ok(again)) if motion.is_err() || again.is_stable() => Ok(again),
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
    solver.solve(0.0, start).map(|(motion, ..)| motion)
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

/// Longest motion that is searched, periods of the base.
const LONGEST: u32 = 32;

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
    for periods in 1..=LONGEST {
        plant.advance(drive, TAU / omega)?;
        let apart = (unknowns(&scale, &plant.state(), omega, amplitude) - here).amax();
        if apart < NEAR {
            match Solver::new(parameters, definition, periods, conditions)?.solve(0.0, here) {
                // A particle that only slides may slide anywhere: one multiplier is 1.
                Ok((motion, ..)) if motion.multipliers[3].norm() < 1.0 + CENTRAL => return Ok(Some(motion)),
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
        let (mut done, mut increase) = (0.0, 1.0);
        loop {
            let next = f64::min(done + increase, if done < 1.0 { 1.0 } else { end });
            let partial = self.with_effects(p, next.min(1.0));
            let second = match response {
                Some(end) => DriveCondition::Response(self.response + (next - 1.0).max(0.0) * (end - self.response)),
                None => DriveCondition::Amplitude(self.amplitude),
            };
            let conditions = [DriveCondition::PhaseResonance, second];
            match Solver::new(&partial, definition, 1, conditions)?.solve(phase, at) {
                // A particle that only rests is another motion: a linear one.
                Ok((motion, ..)) if motion.impacts == 0 => return Err(NoMotion::Lost(next.min(1.0))),
                Ok((motion, ..)) if next == end => return Ok(motion),
                Ok((_, new_phase, new_at)) => (done, phase, at, increase) = (next, new_phase, new_at, 2.0 * increase),
                Err(NoMotion::NotConverged) if increase > SMALLEST_INCREASE => increase *= 0.5,
                Err(NoMotion::NotConverged) if next <= 1.0 => return Err(NoMotion::Lost(next)),
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

/// Steps of forward and of central differences, in units of b, b omega0, sigma and G: square and cube root of the rounding error, where rounding
/// and curvature together contribute least.
const FORWARD: f64 = 1.5e-8;
const CENTRAL: f64 = 6e-6;
/// Largest residual of a solution, in the same units: some ten rounding errors of the period map.
const CLOSED: f64 = 1e-13;
/// Largest residual of a solution where rounding lets it fall no further.
const NEARLY_CLOSED: f64 = 1e-10;
/// Angular frequency, rad/s, of a base at rest that takes the phase to the section in hardly any time.
const AT_ONCE: f64 = 1e9;
/// Iterations, and halvings of a step that does not reduce the residual.
const ITERATIONS: usize = 25;
const HALVINGS: usize = 6;

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

struct Solver<'a> {
    parameters: &'a Parameters,
    definition: Definition,
    conditions: [DriveCondition; 2],
    periods: u32,
    scale: Unknowns,
    /// Phase of the base at the section, rad.
    phase: f64,
    events: Vec<(f64, Event)>,
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
        if definition.resonance == Resonance::Peak {
            return Err(NoMotion::Peak);
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
        let (drive, still) = (Drive::harmonic(amplitude, omega), Drive::harmonic(0.0, AT_ONCE));
        let state = State { q1, dq1, q2, dq2 };
        let mut plant = Plant::new(*self.parameters, state).ok()?;
        plant.begin(still).ok()?;
        plant.advance(still, self.phase / AT_ONCE).ok()?;
        plant.begin(drive).ok()?;
        plant.set_state(state).ok()?;
        Some((plant, drive, TAU * f64::from(self.periods) / omega))
    }

    /// The period map: the state after the motion. The events are kept.
    fn follow(&mut self, (mut plant, drive, duration): Start) -> Option<Vector4<f64>> {
        let events = &mut self.events;
        events.clear();
        let Outcome { cut_short, .. } = plant
            .advance_with(drive, duration, |event| events.push((event.time(), event)))
            .ok()?;
        let State { q1, dq1, q2, dq2 } = plant.state();
        let scale = self.scale.fixed_rows::<4>(0);
        (!cut_short).then(|| Vector4::new(q1, dq1, q2, dq2).component_div(&scale))
    }

    /// First harmonic of the response relative to the reference over the motion whose events were kept, in m.
    fn harmonic(&self, (mut plant, drive, duration): Start) -> Option<Complex<f64>> {
        let Drive { omega, amplitude, .. } = drive;
        let stays = |event: &Event| matches!(event, Event::Stuck { .. } | Event::Sticking { .. });
        let ends = self.events.iter().map(|(t, event)| (*t, stays(event)));
        let (mut now, mut from, mut at_rest, mut sum) = (0.0, 0.0, false, Complex::new(0.0, 0.0));
        let mut go_to = |plant: &mut Plant, t: f64| {
            plant.advance(drive, (t - now).max(0.0)).ok()?;
            now = t;
            Some(plant.state())
        };
        for (to, rests_then) in ends.chain([(duration, false)]) {
            let middle = 0.5 * (from + to);
            // A flight is the parabola through its middle.
            let (flight, acceleration) = if at_rest {
                (State::default(), 0.0)
            } else {
                let state = go_to(&mut plant, middle)?;
                let (gravity, friction) = plant.constant_accelerations();
                (state, gravity + friction)
            };
            let pieces = (omega * (to - from) / PI).ceil().max(1.0);
            let half = 0.5 * (to - from) / pieces;
            for piece in 0..pieces as usize {
                for (node, weight) in gauss() {
                    let t = from + half * ((2 * piece + 1) as f64 + node);
                    let q2 = if at_rest {
                        go_to(&mut plant, t)?.q2
                    } else {
                        let s = t - middle;
                        flight.q2 + s * (flight.dq2 + 0.5 * acceleration * s)
                    };
                    sum += Complex::from_polar(weight * half * q2, -omega * t);
                }
            }
            (from, at_rest) = (to, rests_then);
        }
        // q2 = Im(Q2 exp(i phase)) makes the integral of q2 exp(-i phase) equal to -i Q2/2 times the duration.
        let q2 = sum * Complex::from_polar(2.0 / duration, FRAC_PI_2 - self.phase);
        let p = self.parameters;
        let square = omega * omega;
        let base = Complex::new(p.stiffness, p.damping * omega);
        let q1 = (base * amplitude + q2 * p.particle_mass * square) / (base - p.primary_mass * square);
        let over_omega0 = omega / p.natural_frequency();
        let response = match self.definition.sensor {
            Sensor::V => q1 + q2 * p.mass_ratio(),
            Sensor::Q1 => q1,
            Sensor::Acceleration => q1 * over_omega0.powi(2),
        };
        let damping = p.damping / (p.primary_mass * p.natural_frequency());
        Some(response * Complex::from_polar(1.0, -self.definition.reference.phase(damping, over_omega0)))
    }

    /// The equations at `x`, all over b or as numbers.
    fn residual(&mut self, x: &Unknowns) -> Option<Unknowns> {
        let start = self.start(x)?;
        let end = self.follow(start)?;
        let response = self.harmonic(start)? / self.scale[0];
        let mut residual = Unknowns::zeros();
        residual.fixed_rows_mut::<4>(0).copy_from(&(end - x.fixed_rows::<4>(0)));
        for (row, condition) in [4, 5].into_iter().zip(self.conditions) {
            residual[row] = match condition {
                DriveCondition::Omega(omega) => x[4] - omega / self.scale[4],
                DriveCondition::Amplitude(amplitude) => x[5] - amplitude / self.scale[5],
                DriveCondition::PhaseResonance => response.re,
                DriveCondition::Response(amplitude) => response.im + amplitude / self.scale[0],
                DriveCondition::Across { at: [amplitude, omega], normal } => {
                    normal[0] * (response.im + amplitude / self.scale[0]) - normal[1] * (x[4] - omega / self.scale[4])
                }
            };
        }
        residual.iter().all(|value| value.is_finite()).then_some(residual)
    }

    /// Derivative of the equations by forward differences, or by backward ones where a wall forbids them.
    fn jacobian(&mut self, x: &Unknowns, residual: &Unknowns) -> Option<Matrix6<f64>> {
        let mut jacobian = Matrix6::zeros();
        for column in 0..6 {
            let mut at = |step: f64| {
                let mut x = *x;
                x[column] += step;
                self.residual(&x)
            };
            let slope = match at(FORWARD) {
                Some(above) => (above - residual) / FORWARD,
                None => (residual - at(-FORWARD)?) / FORWARD,
            };
            jacobian.set_column(column, &slope);
        }
        Some(jacobian)
    }

    /// Derivative of the period map by central differences, or by one-sided ones at a wall.
    fn monodromy(&mut self, x: &Unknowns) -> Option<Matrix4<f64>> {
        let mut monodromy = Matrix4::zeros();
        for column in 0..4 {
            let [below, above] = [-CENTRAL, CENTRAL].map(|step| {
                let mut x = *x;
                x[column] += step;
                Some((step, self.follow(self.start(&x)?)?))
            });
            let here = (0.0, x.fixed_rows::<4>(0).into_owned());
            let ((from, below), (to, above)) = (below.unwrap_or(here), above.unwrap_or(here));
            monodromy.set_column(column, &((above - below) / (to - from)));
        }
        Some(monodromy).filter(|map| map.iter().all(|value| value.is_finite()))
    }

    /// Moves the section to the middle of the longest flight of the motion from `x`; with `if_near`, only if it is much nearer to an event now.
    fn centre(&mut self, x: &mut Unknowns, if_near: bool) -> Option<()> {
        let start = self.start(x)?;
        self.follow(start)?;
        let (mut plant, drive, duration) = start;
        let times = self.events.iter().map(|(t, _)| *t);
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

    /// The motion near the unknowns `x` at the phase `phase`, with phase and unknowns at its section.
    fn solve(&mut self, phase: f64, mut x: Unknowns) -> Result<(PlantMotion, f64, Unknowns), NoMotion> {
        self.phase = phase.rem_euclid(TAU);
        self.converge(&mut x).ok_or(NoMotion::NotConverged)?;
        let motion = self.motion(&x).ok_or(NoMotion::NotConverged)?;
        Ok((motion, self.phase, x))
    }

    /// Newton's method.
    fn converge(&mut self, x: &mut Unknowns) -> Option<()> {
        self.centre(x, false)?;
        let mut residual = self.residual(x)?;
        for _ in 0..ITERATIONS {
            let jacobian = self.jacobian(x, &residual)?;
            // The least change where the equations leave a coordinate free.
            let factors = jacobian.svd(true, true);
            let change = factors
                .solve(&residual, f64::EPSILON * factors.singular_values.max())
                .ok()?;
            let mut share = 1.0;
            let next = (0..HALVINGS).find_map(|_| {
                let next = *x - change * share;
                share *= 0.5;
                let smaller = self.residual(&next).filter(|r| r.norm() < residual.norm())?;
                Some((next, smaller))
            });
            match next {
                Some(next) => (*x, residual) = next,
                None if residual.norm() < NEARLY_CLOSED => return Some(()),
                None => return None,
            }
            if residual.norm() < CLOSED {
                return Some(());
            }
            if share == 0.5 {
                let before = self.phase;
                self.centre(x, true)?;
                if self.phase != before {
                    residual = self.residual(x)?;
                }
            }
        }
        None
    }

    /// The motion at the solution `x`.
    fn motion(&mut self, x: &Unknowns) -> Option<PlantMotion> {
        let monodromy = self.monodromy(x)?;
        let mut multipliers: [Complex<f64>; 4] = monodromy.complex_eigenvalues().into();
        multipliers.sort_by(|first, second| first.norm().total_cmp(&second.norm()));
        let start = self.start(x)?;
        self.follow(start)?;
        let response = self.harmonic(start)?;
        let (mut plant, drive, duration) = start;
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
            response,
            multipliers,
            impacts: count(|event| matches!(event, Event::Impact { .. })),
            rests: count(|event| matches!(event, Event::Stuck { .. })),
            sticks: count(|event| matches!(event, Event::Sticking { .. })),
            events,
        })
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
