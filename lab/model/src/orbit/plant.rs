//! Periodic motions of the plant itself, with all effects of its cavity: the return map of a number of periods of the base.
//!
//! Of a plant that is symmetric, the map goes from half a period to half a period, and mirrors the state: the motion that continues the symmetric one
//! of the ideal cavity is then found, and not one beside it that has lost its symmetry.
//!
//! The section is the phase of the base in the middle of the longest flight. Events stay away from it, and all four coordinates are free there,
//! also where the particle sticks later: the map then loses rank, but the map minus the identity does not.

use std::f64::consts::{PI, TAU};

use lovines::cavity::Rebound;
use lovines::{Cavity, Drive, Event, InvalidValue, Outcome, Parameters, Plant, Restitution, State, Wall};
use nalgebra::{Complex, Vector4};
use thiserror::Error;

use super::Orbit;
use super::periodic::SETTLING_DISTANCE;
use super::return_map::{Closing, Condition, Return, ReturnMap, Stability, Unknowns};
use super::shooting::{Shooting, Shot, plant_at};
use super::study::{at_amplitude, at_speed, stable_resonant};
use crate::numerics::{Equations, newton};
use crate::theory::{B_SYMMETRY_BREAKING, Manifold};
use crate::{Definition, Dimensionless};

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
    /// Whether it is minus itself after half a period, by the equations that it solves.
    pub is_mirrored: bool,
    /// First harmonic S of the response relative to the reference, m: the response has the part `Im(S exp(i phase))`.
    pub response: Complex<f64>,
    /// By the multipliers over the whole motion.
    pub stability: Stability,
    /// Impacts over the whole motion.
    pub impacts: usize,
    /// How often the particle comes to rest on a wall, over the whole motion.
    pub rests: usize,
    /// How often it sticks to the floor inside the cavity, over the whole motion.
    pub sticks: usize,
    /// All events with the phase of the base, rad, from 0 to 2 pi times `periods`.
    pub events: Vec<(f64, Event)>,
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
    // Refuses what cannot be solved before anything is computed.
    let c = response / PhaseSection::new(parameters, definition, 1)?.numbers.b;
    let conditions = [
        Condition::Phase(definition.phase),
        Condition::response(definition.phase, c),
    ];
    let near_guess = guess.map(|guess| periodic_motion(parameters, definition, guess, conditions));
    if let Some(result) = near_guess.filter(|result| *result != Err(NoMotion::NotConverged)) {
        return result;
    }
    let of_response = |scene: &Dimensionless| at_amplitude(scene, c);
    // In the middle of the speeds B where the first-order motion is stable.
    let in_the_middle =
        |scene: &Dimensionless| at_speed(scene, 0.5 * (Manifold::new(scene.r).b_min() + B_SYMMETRY_BREAKING));
    let ideal = Ideal::of(parameters, definition, of_response).ok_or(NoMotion::NoIdealMotion(response))?;
    let motion = Ideal { c, ..ideal }.continued(parameters, definition, Some(c));
    if motion.as_ref().is_ok_and(|motion| motion.stability.stable) {
        return motion;
    }
    let detour =
        Ideal::of(parameters, definition, in_the_middle).map(|ideal| ideal.continued(parameters, definition, Some(c)));
    let growth = |motion: &Result<PlantMotion, NoMotion>| {
        motion
            .as_ref()
            .map_or(f64::INFINITY, |motion| motion.stability.growth())
    };
    detour.filter(|again| growth(again) < growth(&motion)).unwrap_or(motion)
}

/// The motion near `guess` that satisfies both conditions, a mirrored one if `guess` is and the plant is symmetric; of `guess`, only this, state, drive
/// and number of periods matter. Lengths of the conditions are over the mean gap, and sigma and G are those of the plant.
pub fn periodic_motion(
    parameters: &Parameters,
    definition: Definition,
    guess: &PlantMotion,
    conditions: [Condition; 2],
) -> Result<PlantMotion, NoMotion> {
    let PlantMotion { state, omega, amplitude, periods, is_mirrored, .. } = *guess;
    let section = PhaseSection::new(parameters, definition, periods)?.mirrored(is_mirrored);
    let start = unknowns(&section.numbers, &state, omega, amplitude);
    Ok(section.solve(0.0, start, conditions)?.motion)
}

/// The motion at phase resonance under a base of the amplitude `amplitude`, m, continued from the stable symmetric motion of the ideal cavity
/// with the smallest response.
pub fn resonant_motion_under(
    parameters: &Parameters,
    definition: Definition,
    amplitude: f64,
) -> Result<PlantMotion, NoMotion> {
    let g = PhaseSection::new(parameters, definition, 1)?
        .numbers
        .excitation(amplitude);
    let motion = |scene: &Dimensionless| stable_resonant(&Dimensionless { g, ..*scene });
    let mut ideal = Ideal::of(parameters, definition, motion).ok_or(NoMotion::NoIdealMotionUnder(amplitude))?;
    ideal.at[5] = g;
    ideal.continued(parameters, definition, None)
}

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
    let numbers = PhaseSection::new(parameters, definition, 1)?.numbers;
    let here = |state: &State| unknowns(&numbers, state, omega, amplitude);
    let (mut plant, drive) = (Plant::new(*parameters, start)?, Drive::harmonic(amplitude, omega));
    plant.begin(drive)?;
    plant.advance(drive, settle as f64 * TAU / omega)?;
    let at = here(&plant.state());
    let conditions = [Condition::Sigma(at[4]), Condition::Excitation(at[5])];
    for periods in 1..=LONGEST_MOTION {
        plant.advance(drive, TAU / omega)?;
        if (here(&plant.state()) - at).amax() < SETTLING_DISTANCE {
            match PhaseSection::new(parameters, definition, periods)?.solve(0.0, at, conditions) {
                // A particle that only slides may slide anywhere: one multiplier is 1.
                Ok(Solution { motion, .. }) if !motion.stability.is_unstable() => return Ok(Some(motion)),
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
    /// Amplitude of the response, over the mean gap.
    c: f64,
    /// The state after an impact on w = +b: phase of the base, rad, and unknowns.
    phase: f64,
    at: Unknowns,
}

/// Rounds in which speed of the impacts and coefficient of restitution, which depend on each other, are found. A remainder is a worse start.
const SPEED_ROUNDS: usize = 8;

impl Ideal {
    /// Of the motion that `motion` gives of the scene with the ideal cavity.
    fn of(p: &Parameters, definition: Definition, motion: impl Fn(&Dimensionless) -> Option<Orbit>) -> Option<Self> {
        let [plus, minus] = p.gaps();
        let [half_width, middle] = [0.5 * (plus + minus), 0.5 * (plus - minus)];
        let rebound = Rebound::new(p);
        let unit = half_width * p.natural_frequency();
        let (mut speed, mut ideal) = (unit, None);
        for _ in 0..SPEED_ROUNDS {
            let [plus, minus] = Wall::BOTH.map(|wall| rebound.mean(wall, speed));
            let (restitution, before) = (0.5 * (plus + minus), speed);
            let Orbit { c, start, sigma, g, impact_velocity, .. } =
                motion(&numbers(&Parameters { restitution, ..*p }, definition))?;
            speed = impact_velocity * unit;
            let q2 = start.q2 - middle / half_width;
            let at = Unknowns::from([start.q1, start.dq1, q2, start.dq2, sigma, g]);
            ideal = Some(Self { speed, restitution, c, phase: start.phase, at });
            if speed == before {
                break;
            }
        }
        ideal
    }

    /// The motion at phase resonance with all effects under the drive of the ideal motion or, if `c` is given, with this response over the mean gap.
    fn continued(&self, p: &Parameters, definition: Definition, c: Option<f64>) -> Result<PlantMotion, NoMotion> {
        let (mut phase, mut at) = (self.phase, self.at);
        // Up to 1 the effects grow, from 1 to 2 the response changes.
        let end = if c.is_none_or(|c| c == self.c) { 1.0 } else { 2.0 };
        let (mut done, mut increase, mut side) = (0.0, 1.0, None);
        loop {
            let next = f64::min(done + increase, if done < 1.0 { 1.0 } else { end });
            let partial = self.with_effects(p, next.min(1.0));
            let second = match c {
                Some(c) => Condition::response(definition.phase, self.c + (next - 1.0).max(0.0) * (c - self.c)),
                None => Condition::Excitation(self.at[5]),
            };
            let conditions = [Condition::Phase(definition.phase), second];
            let section = PhaseSection::new(&partial, definition, 1)?.mirrored(true);
            let found = section.solve(phase, at, conditions);
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

// The return map

/// The numbers of a plant: lengths over the mean gap.
fn numbers(p: &Parameters, definition: Definition) -> Dimensionless {
    let [plus, minus] = p.gaps();
    let ideal = Parameters { half_width: 0.5 * (plus + minus), ..*p };
    Dimensionless { definition, ..Dimensionless::of(&ideal, 0.0) }
}

fn unknowns(numbers: &Dimensionless, state: &State, omega: f64, amplitude: f64) -> Unknowns {
    let [q1, dq1, q2, dq2] = numbers.state(state);
    Unknowns::from([q1, dq1, q2, dq2, numbers.sigma(omega), numbers.excitation(amplitude)])
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

/// The map of a number of periods of the base, or the mirrored one of half a period. The unknowns are (q1, q1', q2, q2') at a phase of the base, sigma
/// and G.
struct PhaseSection<'a> {
    parameters: &'a Parameters,
    numbers: Dimensionless,
    periods: u32,
    is_mirrored: bool,
    /// Phase of the base at the section, rad.
    phase: f64,
    events: Vec<Event>,
}

impl<'a> PhaseSection<'a> {
    fn new(parameters: &'a Parameters, definition: Definition, periods: u32) -> Result<Self, NoMotion> {
        parameters.validate()?;
        if parameters.cavity.scatter > 0.0 {
            return Err(NoMotion::Scatter(parameters.cavity.scatter));
        }
        Ok(Self {
            parameters,
            numbers: numbers(parameters, definition),
            periods,
            is_mirrored: false,
            phase: 0.0,
            events: Vec::new(),
        })
    }

    /// The mirrored map, if it `is_mirrored` and the plant is symmetric.
    fn mirrored(self, is_mirrored: bool) -> Self {
        let [plus, minus] = self.parameters.gaps();
        let is_mirrored = is_mirrored && self.parameters.has_mirror_images() && plus == minus;
        Self { is_mirrored, ..self }
    }

    /// The angle of the base over the map, rad.
    fn turn(&self) -> f64 {
        match self.is_mirrored {
            true => PI,
            false => TAU * f64::from(self.periods),
        }
    }

    /// The scales of the unknowns: b, b omega0, and what a change of sigma or G by 1 is.
    fn scale(&self) -> Unknowns {
        let d = &self.numbers;
        let (length, speed) = (d.b, d.b * d.omega0);
        Unknowns::from([length, speed, length, speed, d.omega_change(1.0), d.amplitude(1.0)])
    }

    /// The plant at the section in the state and under the drive of `x`.
    fn start(&self, x: &Unknowns) -> Option<Start> {
        let [q1, dq1, q2, dq2, _, amplitude] = x.component_mul(&self.scale()).into();
        let omega = self.numbers.omega(x[4]);
        if !(omega > 0.0 && omega.is_finite()) {
            return None;
        }
        let (drive, state) = (Drive::harmonic(amplitude, omega), State { q1, dq1, q2, dq2 });
        let plant = plant_at(self.parameters, state, drive, self.phase)?;
        Some((plant, drive, self.turn() / omega))
    }

    /// The state after the motion. The events are kept.
    fn follow(&mut self, (mut plant, drive, duration): Start) -> Option<State> {
        let events = &mut self.events;
        events.clear();
        let Outcome { cut_short, .. } = plant.advance_with(drive, duration, |event| events.push(event)).ok()?;
        (!cut_short).then(|| plant.state())
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
            *x = unknowns(&self.numbers, &state, omega, amplitude);
        }
        Some(())
    }

    /// The motion near the unknowns `x` at the phase `phase` that satisfies both conditions.
    fn solve(mut self, phase: f64, mut x: Unknowns, conditions: [Condition; 2]) -> Result<Solution, NoMotion> {
        self.phase = phase.rem_euclid(TAU);
        self.centre(&mut x, false).ok_or(NoMotion::NotConverged)?;
        let mut closing = Closing { map: &mut self, conditions };
        let found = newton(&mut closing, x).and_then(|at| Some((at, closing.at(&at)?.1)));
        let (at, jacobian) = found.ok_or(NoMotion::NotConverged)?;
        let motion = self.motion(&at).ok_or(NoMotion::NotConverged)?;
        let side = jacobian.determinant().signum();
        Ok(Solution { motion, phase: self.phase, at, side })
    }

    /// The motion at the solution `x`.
    fn motion(&mut self, x: &Unknowns) -> Option<PlantMotion> {
        let returned = self.at(x)?;
        let (mut plant, drive, _) = self.start(x)?;
        let Drive { omega, amplitude, .. } = drive;
        // A particle at rest in the section has settled on its wall, without the residual of the solution, where the phase is 0.
        plant.advance(drive, (TAU - self.phase) / omega).ok()?;
        let state = plant.state();
        let mut events = Vec::new();
        let record = |event: Event| events.push((omega * event.time(), event));
        plant
            .advance_with(drive, TAU * f64::from(self.periods) / omega, record)
            .ok()?;
        let count = |is: fn(&Event) -> bool| events.iter().filter(|(_, event)| is(event)).count();
        Some(PlantMotion {
            state,
            omega,
            amplitude,
            periods: self.periods,
            is_mirrored: self.is_mirrored,
            response: returned.response * self.numbers.b,
            stability: if self.is_mirrored {
                returned.stability().twice()
            } else {
                returned.stability()
            },
            impacts: count(|event| matches!(event, Event::Impact { .. })),
            rests: count(|event| matches!(event, Event::Stuck { .. })),
            sticks: count(|event| matches!(event, Event::Sticking { .. })),
            events,
        })
    }
}

impl ReturnMap for PhaseSection<'_> {
    fn at(&mut self, x: &Unknowns) -> Option<Return> {
        let start = self.start(x)?;
        let end = self.follow(start)?;
        let (plant, drive, duration) = start;
        let mut shot = Shot::new(&plant, &drive, self.phase);
        for event in &self.events {
            shot.pass(event, 0.0);
        }
        shot.advance((duration - shot.elapsed()).max(0.0));
        let mut by = shot.derivatives();
        // The duration depends on the frequency.
        let shorter = -duration / drive.omega;
        by.column_mut(4).axpy(shorter, &shot.rates(), 1.0);
        let shooting = Shooting {
            parameters: self.parameters,
            definition: self.numbers.definition,
            scale: self.scale(),
        };
        let sign = if self.is_mirrored { -1.0 } else { 1.0 };
        by.fixed_rows_mut::<4>(0).scale_mut(sign);
        let apart = Vector4::from(self.numbers.state(&end)) * sign - x.fixed_rows::<4>(0);
        Some(shooting.returned(&drive, self.turn(), apart, shot.harmonic, &by))
    }

    fn restarted(&mut self, x: &Unknowns) -> Option<Unknowns> {
        let (before, mut x) = (self.phase, *x);
        self.centre(&mut x, true)?;
        (self.phase != before).then_some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::super::impacts::{ImpactPattern, ImpactSection};
    use super::*;

    /// Largest differences of the derivatives of a return, and of its response, from central differences.
    fn off(map: &mut impl ReturnMap, x: &Unknowns) -> [f64; 2] {
        let step = 1e-6;
        let here = map.at(x).expect("a return");
        let mut off = [0.0_f64; 2];
        for n in 0..6 {
            let [after, before] = [step, -step].map(|step| {
                let mut moved = *x;
                moved[n] += step;
                map.at(&moved).expect("a return")
            });
            let apart = (after.apart - before.apart) / (2.0 * step) - here.closing().column(n);
            let response = (after.response - before.response) / (2.0 * step) - here.response_by[n];
            off = [off[0].max(apart.amax()), off[1].max(response.norm())];
        }
        off
    }

    #[test]
    fn the_derivatives_of_both_return_maps_are_those_of_differences() {
        let scene = Dimensionless {
            definition: Definition {
                reference: crate::Reference::Force,
                sensor: crate::Sensor::Q1,
                ..Definition::default()
            },
            ..Dimensionless::new(0.05, 1.2, 0.6, 0.0)
        };
        let ideal = at_speed(&scene, 0.9).expect("an orbit");
        let x = ideal.unknowns() + Unknowns::from([0.01, 0.002, -0.01, 0.02, 0.1, 0.05]);
        let symmetric = ImpactPattern::symmetric();
        for pattern in [symmetric.doubled(), symmetric.doubled().doubled(), symmetric] {
            let off = off(&mut ImpactSection { scene: &scene, pattern: &pattern }, &x);
            assert!(off[0] < 1e-6 && off[1] < 1e-6, "{pattern:?}: {off:?}");
        }
        let cavity = Cavity {
            kinetic_friction: 0.003,
            tilt: 0.002,
            b_plus: Some(1.02),
            ..Cavity::IDEAL
        };
        let p = Parameters {
            cavity,
            ..Parameters::dimensionless(scene.epsilon, scene.lambda, scene.r)
        };
        let motion = resonant_motion(&p, scene.definition, ideal.c, None).expect("a motion");
        let mut section = PhaseSection::new(&p, scene.definition, 2).expect("a plant");
        let mut x = unknowns(&section.numbers, &motion.state, motion.omega, motion.amplitude);
        section.centre(&mut x, false);
        let off = off(&mut section, &(x + Unknowns::repeat(1e-3)));
        assert!(off[0] < 1e-6 && off[1] < 1e-6, "{off:?}");
    }
}
