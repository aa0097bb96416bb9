//! Shooting: a motion of the plant from a start on, with the derivatives of its state and of its first harmonic by start and drive.
//!
//! The plant's motion and its derivative ([`Variation`]) are closed forms between events, exact to rounding. The first harmonic of the particle is
//! integrated by Gauss's rule from event to event, where the motion is analytic. The balance of momentum gives the one of the primary mass:
//! `(k - M omega² + i c omega) Q1 = (k + i c omega) E + m omega² Q2` (docs/regimes.md, eq. 26).

use std::f64::consts::{PI, TAU};

use lovines::{Drive, Event, Parameters, Plant, State, Variation};
use nalgebra::{Complex, Matrix4x6, Matrix6, Vector4, Vector6};

use super::return_map::{Return, Unknowns};
use crate::{Definition, Sensor};

/// Angular frequency, rad/s, of a base at rest that takes its phase to the start in hardly any time.
const AT_ONCE: f64 = 1e9;

/// A plant in a state at a phase of its drive.
pub(super) fn plant_at(parameters: &Parameters, state: State, drive: Drive, phase: f64) -> Option<Plant> {
    let still = Drive::harmonic(0.0, AT_ONCE);
    let mut plant = Plant::new(*parameters, state).ok()?;
    plant.begin(still).ok()?;
    plant.advance(still, phase.rem_euclid(TAU) / AT_ONCE).ok()?;
    plant.begin(drive).ok()?;
    plant.set_state(state).ok()?;
    Some(plant)
}

/// A motion from a start on.
pub(super) struct Shot {
    variation: Variation,
    /// Phase of the base at the start, rad, and its angular frequency.
    phase: f64,
    omega: f64,
    /// The integral of `q2 exp(-i phase)` over time, and its derivatives by (q1, q1', q2, q2') at the start, frequency and amplitude.
    pub harmonic: Complex<f64>,
    harmonic_by: [Complex<f64>; 6],
}

impl Shot {
    /// From now on.
    pub(super) fn new(plant: &Plant, drive: &Drive, phase: f64) -> Self {
        Self {
            variation: Variation::of(plant),
            phase,
            omega: drive.omega,
            harmonic: Complex::ZERO,
            harmonic_by: [Complex::ZERO; 6],
        }
    }

    /// Time since the start.
    pub(super) fn elapsed(&self) -> f64 {
        self.variation.elapsed()
    }

    /// Moves on to an event, and past it. `since` is the time of the start on the event's clock.
    pub(super) fn pass(&mut self, event: &Event, since: f64) {
        self.integrate(event.time() - since - self.elapsed());
        self.variation.pass(event, since);
    }

    /// Moves on by `t`, in which there is no event.
    pub(super) fn advance(&mut self, t: f64) {
        self.integrate(t);
        self.variation.advance(t);
    }

    /// Rates of (q1, q1', q2, q2') and of both parts of the harmonic.
    pub(super) fn rates(&self) -> Vector6<f64> {
        let [q1, dq1, q2, dq2] = self.variation.rates();
        let z = self.turned(self.variation.state().q2, self.elapsed());
        Vector6::from([q1, dq1, q2, dq2, z.re, z.im])
    }

    /// Derivatives of (q1, q1', q2, q2') and of both parts of the harmonic, by (q1, q1', q2, q2') at the start, frequency and amplitude.
    pub(super) fn derivatives(&self) -> Matrix6<f64> {
        let [q1, dq1, q2, dq2] = *self.variation.derivatives();
        let [re, im] = [self.harmonic_by.map(|by| by.re), self.harmonic_by.map(|by| by.im)];
        Matrix6::from([q1, dq1, q2, dq2, re, im]).transpose()
    }

    /// `size exp(-i phase)`, some time after the start.
    fn turned(&self, size: f64, since: f64) -> Complex<f64> {
        Complex::from_polar(size, -(self.phase + self.omega * since))
    }

    /// Adds the integral over a time without events.
    fn integrate(&mut self, duration: f64) {
        let from = self.variation;
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
                    let mut at = from;
                    at.advance(t);
                    (at.state().q2, at.derivatives()[2])
                };
                let since = from.elapsed() + t;
                let turned = self.turned(weight * half, since);
                self.harmonic += turned * q2;
                for (sum, by) in self.harmonic_by.iter_mut().zip(q2_by) {
                    *sum += turned * by;
                }
                self.harmonic_by[4] += turned * Complex::new(0.0, -since * q2);
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

/// A plant, what is measured of it, and the scales of its unknowns.
pub(super) struct Shooting<'a> {
    pub parameters: &'a Parameters,
    pub definition: Definition,
    /// The first is a length.
    pub scale: Unknowns,
}

impl Shooting<'_> {
    /// The return after the angle `turn` of the base, rad. `by`: the derivatives of the four coordinates at the end and of both parts of the harmonic,
    /// by the coordinates at the start, frequency and amplitude.
    pub(super) fn returned(
        &self,
        drive: &Drive,
        turn: f64,
        apart: Vector4<f64>,
        harmonic: Complex<f64>,
        by: &Matrix6<f64>,
    ) -> Return {
        let scale = &self.scale;
        let harmonic_by = [0, 1, 2, 3, 4, 5].map(|n| Complex::new(by[(4, n)], by[(5, n)]));
        let (response, response_by) = self.response(drive, turn / drive.omega, harmonic, harmonic_by);
        Return {
            apart,
            by: Matrix4x6::from_fn(|row, column| by[(row, column)] * scale[column] / scale[row]),
            response: response / scale[0],
            response_by: std::array::from_fn(|n| response_by[n] * (scale[n] / scale[0])),
        }
    }

    /// First harmonic of the response relative to the reference, and its derivatives by the coordinates at the start, frequency and amplitude.
    fn response(
        &self,
        drive: &Drive,
        duration: f64,
        harmonic: Complex<f64>,
        by: [Complex<f64>; 6],
    ) -> (Complex<f64>, [Complex<f64>; 6]) {
        let Drive { omega, amplitude, .. } = *drive;
        // q2 = Im(Q2 exp(i phase)) makes the integral of q2 exp(-i phase) equal to -i Q2/2 times the duration.
        let factor = Complex::new(0.0, 2.0 / duration);
        let q2 = harmonic * factor;
        let mut q2_by = by.map(|by| by * factor);
        q2_by[4] += q2 / omega;

        let p = self.parameters;
        let (omega0, inertia) = (p.natural_frequency(), p.particle_mass * omega * omega);
        let base = Complex::new(p.stiffness, p.damping * omega);
        let stiffness = base - p.primary_mass * omega * omega;
        let of_particle = match self.definition.sensor {
            Sensor::V => p.mass_ratio(),
            Sensor::Q1 => 0.0,
        };
        let (damping, over_omega0) = (p.damping / (p.primary_mass * omega0), omega / omega0);
        let reference = self.definition.reference;
        let turned = Complex::from_polar(1.0, -reference.phase(damping, over_omega0));
        // The response is linear in E and Q2.
        let (by_amplitude, by_inertia) = (turned * base / stiffness, turned * inertia / stiffness);
        let by_q2 = by_inertia + turned * of_particle;
        let response = by_amplitude * amplitude + by_q2 * q2;
        let mut by = q2_by.map(|by| by_q2 * by);
        let base_rate = Complex::new(0.0, p.damping);
        let stiffness_rate = (base_rate - 2.0 * p.primary_mass * omega) / stiffness;
        by[4] += by_amplitude * amplitude * (base_rate / base - stiffness_rate)
            + by_inertia * q2 * (-stiffness_rate + 2.0 / omega)
            - response * Complex::i() * (reference.phase_slope(damping, over_omega0) / omega0);
        by[5] += by_amplitude;
        (response, by)
    }
}
