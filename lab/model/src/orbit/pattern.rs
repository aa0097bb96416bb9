//! A pattern of impacts and the equations that close it: the return map, its derivative, and the first harmonic of v (docs/theory.md, eq. 26).

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, Matrix4, Vector4};
use serde::Serialize;

use super::bounce::Bounce;
use super::impact_map::{ByAll, ImpactMap, RowByAll, Step};
use crate::{Definition, Dimensionless, Sensor};

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

    /// Two impacts per period, half a period apart.
    pub fn is_symmetric(&self) -> bool {
        self.mirrored && self.is_one_to_one()
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
        let mut walls = self.walls.clone();
        if self.mirrored {
            walls.extend(self.walls.iter().map(|wall| -wall));
        } else {
            walls.extend(&self.walls);
        }
        Self { walls, half_periods: 2 * self.half_periods, mirrored: false }
    }

    /// The pattern of half the length that this one doubles; None if it does not repeat itself or its mirror image.
    pub fn halved(&self) -> Option<Self> {
        let count = self.walls.len() / 2;
        let (walls, rest) = self.walls.split_at(count);
        let half = Self {
            walls: walls.into(),
            half_periods: self.half_periods / 2,
            mirrored: !self.half_periods.is_multiple_of(4),
        };
        let same = walls.iter().zip(rest).all(|(one, other)| half.sign() * one == *other);
        (!self.mirrored && self.walls.len().is_multiple_of(2) && count > 0 && same).then_some(half)
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

/// Unknowns of a periodic motion: (phase, q1, q1', q2') after its first impact, sigma, G.
pub type Unknowns = nalgebra::SVector<f64, 6>;

/// The return map of a pattern from one start.
#[derive(Debug, Clone)]
pub(super) struct Returned {
    /// Closing error of the motion.
    pub residual: Vector4<f64>,
    /// Derivative of the residual by the unknowns.
    pub by: ByAll,
    /// First harmonic of the response relative to the reference: `Im(S exp(i phase))`.
    pub s: Complex<f64>,
    /// Derivative of S by the unknowns, real and imaginary part.
    pub s_by: [RowByAll; 2],
    /// The bounces over the map, with the start and without the return.
    pub bounces: Vec<Bounce>,
    /// Time of flight after each.
    pub durations: Vec<f64>,
    /// Derivative of the return map by the state: its eigenvalues are the multipliers.
    pub monodromy: Matrix4<f64>,
}

/// Follows the pattern from the unknowns `x`; None if the impacts have another pattern or graze.
pub(super) fn follow(scene: &Dimensionless, pattern: &ImpactPattern, x: &Unknowns) -> Option<Returned> {
    let (sigma, g) = (x[4], x[5]);
    let omega = 1.0 + scene.epsilon * sigma;
    if !(omega > 0.0 && omega.is_finite() && g.is_finite()) {
        return None;
    }
    let map = ImpactMap::new(scene, omega, g);
    let start = Bounce::from_vector(&x.fixed_rows::<4>(0).into(), pattern.walls[0]);
    let mut at = start;
    let mut by = ByAll::identity();
    let mut sum = Complex::new(0.0, 0.0);
    let mut sum_by = [RowByAll::zeros(); 2];
    let (mut bounces, mut durations) = (Vec::new(), Vec::new());
    for n in 0..pattern.walls.len() {
        let step = map.step(&at)?;
        let wall = match pattern.walls.get(n + 1) {
            Some(wall) => *wall,
            None => pattern.sign() * pattern.walls[0],
        };
        if step.next.wall != wall {
            return None;
        }
        bounces.push(at);
        durations.push(step.duration);
        let impulse_by;
        (by, impulse_by) = chained(&step, &by);
        at = step.next;
        let phasor = Complex::from_polar(1.0, -at.phase);
        sum += phasor * step.impulse;
        let phase_by = by.row(0) * -step.impulse;
        sum_by[0] += impulse_by * phasor.re - phase_by * phasor.im;
        sum_by[1] += impulse_by * phasor.im + phase_by * phasor.re;
    }

    let residual = start.apart(&at, pattern.turn(), pattern.sign());
    by.fixed_rows_mut::<3>(1).scale_mut(pattern.sign());
    let monodromy: Matrix4<f64> = by.fixed_columns::<4>(0).into();
    by.fixed_columns_mut::<4>(0)
        .copy_from(&(monodromy - Matrix4::identity()));
    by.column_mut(4).scale_mut(scene.epsilon);

    let harmonic = Harmonic::new(scene, &map, pattern);
    let (s, s_by) = harmonic.of(g, sum, &sum_by, scene.epsilon);
    Some(Returned { residual, by, s, s_by, bounces, durations, monodromy })
}

/// The chain rule: derivatives of a step by the unknowns. The step itself also depends on Omega and G.
fn chained(step: &Step, by: &ByAll) -> (ByAll, RowByAll) {
    let state: Matrix4<f64> = step.by.fixed_columns::<4>(0).into();
    let mut all = state * by;
    let mut impulse_by = step.impulse_by.fixed_columns::<4>(0) * by;
    for column in 4..6 {
        all.set_column(column, &(all.column(column) + step.by.column(column)));
        impulse_by[column] += step.impulse_by[column];
    }
    (all, impulse_by)
}

/// `S = direct G + impulses sum`: the base through the oscillator, and the impulses through the oscillator and, for v, the particle.
struct Harmonic {
    direct: [Complex<f64>; 2],
    impulses: [Complex<f64>; 2],
}

impl Harmonic {
    /// Each coefficient with its derivative by Omega.
    fn new(scene: &Dimensionless, map: &ImpactMap, pattern: &ImpactPattern) -> Self {
        let omega = map.oscillator.omega;
        let zeta = scene.epsilon * scene.lambda / 2.0;
        let compliance = map.oscillator.free.compliance(omega);
        let compliance_by = -compliance * compliance * Complex::new(-2.0 * omega, 2.0 * zeta);
        let force = map.oscillator.free.base_force(omega);
        let direct = force * compliance * scene.epsilon;
        let direct_by = (Complex::new(0.0, 2.0 * zeta) * compliance + force * compliance_by) * scene.epsilon;
        // (2i/duration) times the response to a force through the oscillator, less that of a free mass: the impulse on the
        // particle is the opposite one.
        let weight = Complex::new(0.0, 2.0 * omega / pattern.turn());
        let Definition { sensor, reference, .. } = scene.definition;
        let particle = f64::from(u8::from(sensor == Sensor::V));
        let inner = compliance + particle / (omega * omega);
        let inner_by = compliance_by - 2.0 * particle / omega.powi(3);
        // The factor of the sensor, seen from the reference, and its logarithmic derivative.
        let damping = scene.epsilon * scene.lambda;
        let (factor, slope) = if sensor == Sensor::Acceleration {
            (omega * omega, 2.0 / omega)
        } else {
            (1.0, 0.0)
        };
        let seen = Complex::from_polar(factor, -reference.phase(damping, omega));
        let seen_by = Complex::new(slope, -reference.phase_slope(damping, omega));
        let read = |[z, by]: [Complex<f64>; 2]| [z * seen, (by + z * seen_by) * seen];
        Self {
            direct: read([direct, direct_by]),
            impulses: read([weight * inner, weight * inner_by + weight / omega * inner]),
        }
    }

    fn of(&self, g: f64, sum: Complex<f64>, sum_by: &[RowByAll; 2], epsilon: f64) -> (Complex<f64>, [RowByAll; 2]) {
        let zero_if_undriven = |z: Complex<f64>| {
            if g == 0.0 && z.is_nan() {
                Complex::new(0.0, 0.0)
            } else {
                z
            }
        };
        let s = zero_if_undriven(self.direct[0] * g) + self.impulses[0] * sum;
        let a = self.impulses[0];
        let mut by = [sum_by[0] * a.re - sum_by[1] * a.im, sum_by[0] * a.im + sum_by[1] * a.re];
        let own = [
            zero_if_undriven(self.direct[1] * g) + self.impulses[1] * sum,
            self.direct[0],
        ];
        for (column, own) in [4, 5].into_iter().zip(own) {
            by[0][column] += own.re;
            by[1][column] += own.im;
        }
        for row in &mut by {
            row[4] *= epsilon;
        }
        (s, by)
    }
}

/// A phase in (-pi, pi].
pub(super) fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU).round()
}
