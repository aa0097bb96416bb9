//! Motions by their impacts: patterns, and the return map of a pattern.
//!
//! The section is the state just after an impact: it moves along with a curve of motions, and the map has derivatives wherever the pattern stays
//! the same. A disturbed motion reaches the wall a little earlier or later, which moves its state along the motion, and its phase. A start at
//! another phase of the base is the same motion, begun earlier or later.

use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;

use lovines::{Drive, Event, Parameters, Plant, State};
use nalgebra::{Matrix6, RowVector6, Vector4, Vector6};
use serde::Serialize;

use super::flight::GRAZING;
use super::return_map::{Return, ReturnMap, Unknowns};
use super::shooting::{Shooting, Shot, plant_at};
use crate::Dimensionless;

/// The pattern of a periodic motion. A mirrored one is minus itself after half of its period; its map covers that half.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImpactPattern {
    /// Walls hit, one after another, over the map; the first is the one the motion starts from.
    pub walls: Vec<f64>,
    /// Half periods of the base over the map: even, except for a mirrored pattern, where it is odd.
    pub half_periods: u32,
    /// Minus itself after those half periods.
    pub mirrored: bool,
}

impl ImpactPattern {
    /// Two impacts per period, half a period apart: symmetric 1:1.
    pub fn symmetric() -> Self {
        Self { walls: vec![1.0], half_periods: 1, mirrored: true }
    }

    /// Two impacts per period.
    pub fn is_one_to_one(&self) -> bool {
        self.periods() == 1 && self.impacts() == 2
    }

    /// As in a table.
    pub fn name(&self) -> String {
        let (impacts, periods) = (self.impacts(), self.periods());
        match (impacts, periods) {
            (2, 1) if self.mirrored => "symmetric 1:1".into(),
            (2, 1) => "asymmetric 1:1".into(),
            _ => {
                let plural = |count: usize| if count == 1 { "" } else { "s" };
                let mirrored = if self.mirrored { ", mirrored" } else { "" };
                let (s, t) = (plural(impacts), plural(periods as usize));
                format!("{impacts} impact{s} in {periods} period{t}{mirrored}")
            }
        }
    }

    /// The same pattern over a whole period, as after symmetry breaking.
    pub fn doubled(&self) -> Self {
        let again = self.walls.iter().map(|wall| self.sign() * wall);
        let walls = self.walls.iter().copied().chain(again).collect();
        Self { walls, half_periods: 2 * self.half_periods, mirrored: false }
    }

    /// Impacts over the whole period of the motion.
    pub fn impacts(&self) -> usize {
        self.walls.len() * if self.mirrored { 2 } else { 1 }
    }

    /// Periods of the base over the whole period of the motion.
    pub fn periods(&self) -> u32 {
        if self.mirrored {
            self.half_periods
        } else {
            self.half_periods / 2
        }
    }

    pub(super) fn sign(&self) -> f64 {
        if self.mirrored { -1.0 } else { 1.0 }
    }

    pub(super) fn turn(&self) -> f64 {
        f64::from(self.half_periods) * PI
    }
}

/// State just after an impact. The base displacement is `epsilon G sin(phase)` there, and the particle is at `q1 - wall`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bounce {
    /// Phase of the base, rad; it grows from impact to impact.
    pub phase: f64,
    /// Displacement of the primary mass over b.
    pub q1: f64,
    /// Velocity of the primary mass over `b omega0`.
    pub dq1: f64,
    /// Velocity of the particle over `b omega0`.
    pub dq2: f64,
    /// The wall that was hit: +1 for w = +1, -1 for w = -1.
    pub wall: f64,
}

impl Bounce {
    fn vector(&self) -> Vector4<f64> {
        Vector4::new(self.phase, self.q1, self.dq1, self.dq2)
    }

    /// How far `later` is from repeating this state after the base has turned by `turn`, rad; with the sign -1, from its mirror image.
    pub(super) fn apart(&self, later: &Bounce, turn: f64, sign: f64) -> Vector4<f64> {
        let mut apart = later.vector() * sign - self.vector();
        apart[0] = later.phase - self.phase - turn;
        apart
    }

    /// Displacement of the particle over b.
    pub fn q2(&self) -> f64 {
        self.q1 - self.wall
    }

    /// (q1, q1', q2, q2').
    fn state(&self) -> [f64; 4] {
        [self.q1, self.dq1, self.q2(), self.dq2]
    }
}

/// Longest flight, periods.
const LONGEST_FLIGHT: f64 = 64.0;

/// The impacts of a motion of the dimensionless plant, one after another, each with the state after it. They end where the particle sticks, grazes a
/// wall, or meets none within many periods.
#[derive(Clone, Copy)]
pub(super) struct Impacts {
    plant: Plant,
    drive: Drive,
    phase: f64,
}

impl Impacts {
    /// From a state (q1, q1', q2, q2') at a phase of the base.
    pub(super) fn new(scene: &Dimensionless, sigma: f64, phase: f64, state: [f64; 4]) -> Option<Self> {
        let parameters = Parameters::dimensionless(scene.epsilon, scene.lambda, scene.r);
        let drive = scene.drive(sigma);
        let plant = plant_at(&parameters, state.into(), drive, phase).filter(|_| drive.omega > 0.0)?;
        Some(Self { plant, drive, phase })
    }

    /// After an impact, from which the particle must move away.
    pub(super) fn after(scene: &Dimensionless, sigma: f64, bounce: &Bounce) -> Option<Self> {
        let leaves = (bounce.dq1 - bounce.dq2) * bounce.wall < 0.0;
        Self::new(scene, sigma, bounce.phase, bounce.state()).filter(|_| leaves)
    }
}

impl Iterator for Impacts {
    type Item = (Event, Bounce);

    fn next(&mut self) -> Option<Self::Item> {
        let (omega, mut next) = (self.drive.omega, None);
        let first = |event| {
            next = Some(event);
            ControlFlow::Break(())
        };
        self.plant
            .advance_until(self.drive, LONGEST_FLIGHT * TAU / omega, first)
            .ok()?;
        let Some(event @ Event::Impact { t, wall, velocity }) = next else {
            return None;
        };
        self.phase += omega * t;
        let State { q1, dq1, dq2, .. } = self.plant.state();
        let bounce = Bounce { phase: self.phase, q1, dq1, dq2, wall: wall.sign() };
        (velocity.abs() > GRAZING * omega).then_some((event, bounce))
    }
}

/// The return map of a pattern. The unknowns are (phase, q1, q1', q2') after its first impact, sigma and G.
pub(super) struct ImpactSection<'a> {
    pub scene: &'a Dimensionless,
    pub pattern: &'a ImpactPattern,
}

impl ImpactSection<'_> {
    /// The return from the unknowns `x`, and `bounce` of each state after an impact, from the start to the last before the return, with the time
    /// of flight after it. None if the impacts have another pattern or graze.
    pub(super) fn follow(&self, x: &Unknowns, mut bounce: impl FnMut(Bounce, f64)) -> Option<Return> {
        let [phase, q1, dq1, dq2, sigma, g] = (*x).into();
        let (pattern, scene) = (self.pattern, Dimensionless { g, ..*self.scene });
        let start = Bounce { phase, q1, dq1, dq2, wall: pattern.walls[0] };
        let impacts = Impacts::after(&scene, sigma, &start)?;
        let (plant, drive) = (impacts.plant, impacts.drive);
        let mut shot = Shot::new(&plant, &drive, phase);
        let begun = shot.rates();
        let (mut at, mut count) = (start, 0);
        let last = pattern.sign() * pattern.walls[0];
        let walls = pattern.walls.iter().copied().skip(1).chain([last]);
        for (wall, (event, next)) in walls.zip(impacts) {
            if next.wall != wall {
                return None;
            }
            bounce(at, event.time());
            shot.pass(&event, -shot.elapsed());
            at = next;
            count += 1;
        }
        (count == pattern.walls.len()).then_some(())?;

        let mut by = at_impact(&shot, &begun, drive.omega);
        by.fixed_rows_mut::<3>(1).scale_mut(pattern.sign());
        let shooting = Shooting {
            parameters: plant.parameters(),
            definition: scene.definition,
            scale: Unknowns::from([1.0, 1.0, 1.0, 1.0, scene.epsilon, scene.epsilon]),
        };
        let apart = start.apart(&at, pattern.turn(), pattern.sign());
        Some(shooting.returned(&drive, pattern.turn(), apart, shot.harmonic, &by))
    }
}

impl ReturnMap for ImpactSection<'_> {
    fn at(&mut self, x: &Unknowns) -> Option<Return> {
        self.follow(x, |_, _| {})
    }
}

/// Derivative of (phase, q1, q1', q2') after the impact that was passed last, and of both parts of the harmonic, by (phase, q1, q1', q2') at the
/// start, frequency and amplitude. `begun` are the rates at the start.
fn at_impact(shot: &Shot, begun: &Vector6<f64>, omega: f64) -> Matrix6<f64> {
    let (by, rates) = (shot.derivatives(), shot.rates());
    let mut earlier = rates - by.fixed_columns::<4>(0) * begun.fixed_rows::<4>(0);
    // An integral also loses its beginning.
    for row in [4, 5] {
        earlier[row] -= begun[row];
    }
    let mut fixed = Matrix6::from_columns(&[
        earlier / omega,
        by.column(0) + by.column(2),
        by.column(1).into(),
        by.column(3).into(),
        by.column(4).into(),
        by.column(5).into(),
    ]);
    // At a fixed time the relative displacement is off the wall; at a fixed distance the time is off.
    let early: RowVector6<f64> = (fixed.row(2) - fixed.row(0)) / (rates[0] - rates[2]);
    fixed += rates * early;
    let mut phase = early * omega;
    phase[0] += 1.0;
    phase[4] += shot.elapsed();
    let [q1, dq1, dq2, re, im] = [0, 1, 3, 4, 5].map(|row| fixed.row(row).into_owned());
    Matrix6::from_rows(&[phase, q1, dq1, dq2, re, im])
}
