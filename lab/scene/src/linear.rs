//! The linear response of the structure as a measurement of its own, with the state of the particle that it belongs to.
//!
//! `vines check`, the loop check before an experiment, and a decay without impacts measure it. It is data for a fit of the parameters:
//!
//! - `tracked.json`, `identification.json` and the JSON of `vines check` have it under the key `linear`;
//! - `tracked.csv` has it in the columns [`MeasuredLinear::COLUMNS`], the same values in every row.
//!
//! A particle that no wall touches is free, or is carried along, or friction does something between the two.
//! With m/M = epsilon, a free particle leaves `f0` and `zeta`; a carried one gives `f0/sqrt(1 + epsilon)` and `zeta/sqrt(1 + epsilon)`, because
//! the mass is M + m and the damper is the same.

use std::f64::consts::{PI, TAU};

use lovines::Parameters;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use vines_model::Reference;
use vines_model::numerics::{Estimate, SIGNIFICANT};

use crate::shaker_path::ShakerPath;

/// What the particle does while no wall touches it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ParticleState {
    /// It moves with the structure, as one mass.
    Carried,
    /// It does not act on the structure.
    Free,
    /// One of the two, or sliding friction between them: the measurement cannot tell.
    Unknown,
}

impl ParticleState {
    /// Smallest and largest mass that moves with the structure, over the particle's mass in the drawing.
    pub fn carried(self) -> [f64; 2] {
        match self {
            Self::Free => [0.0, 0.0],
            Self::Carried => [LARGEST_RATIO.recip(), LARGEST_RATIO],
            Self::Unknown => [0.0, LARGEST_RATIO],
        }
    }
}

/// Natural frequency and damping ratio of the structure as measured, in one state of the particle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeasuredLinear {
    /// Natural frequency, Hz, in this state of the particle.
    #[serde(rename = "f0_Hz")]
    pub f0: f64,
    /// Its standard uncertainty, Hz.
    #[serde(rename = "u_f0_Hz")]
    pub u_f0: f64,
    /// Damping ratio, in this state of the particle.
    pub zeta: f64,
    /// Its standard uncertainty.
    pub u_zeta: f64,
    /// Correlation of the two.
    pub correlation: f64,
    /// The state of the particle.
    pub particle: ParticleState,
}

impl MeasuredLinear {
    /// Its columns in a table, in the order of its fields.
    pub const COLUMNS: [&str; 6] = [
        "linear_f0_Hz",
        "linear_u_f0_Hz",
        "linear_zeta",
        "linear_u_zeta",
        "linear_correlation",
        "linear_particle",
    ];

    /// Natural frequency, Hz, and damping ratio.
    pub fn estimates(&self) -> [Estimate; 2] {
        [(self.f0, self.u_f0), (self.zeta, self.u_zeta)].map(|(value, uncertainty)| Estimate { value, uncertainty })
    }
}

// What a particle does to the structure that no wall touches.
//
// The force of a particle on the structure is -m q2''. Its fundamental adds the complex mass m χ, where χ is the fundamental of q2 over that of q1:
// 1 if the particle is carried, 0 if it is free. Dry friction moves the particle's velocity towards the structure's, never beyond it. Of a
// harmonic motion, viscous friction of any size gives |χ - 1/2| = 1/2 exactly. Coulomb friction that slides all the time gives
// |χ|² = (8/π²) Re χ (the triangle wave of the particle's velocity lags by the angle at which the two velocities are equal), and sticking
// leads from there to 1. All of it lies within the disc |χ - 1/2| <= 1/2; so does what changes between them, because a disc is convex.
// A stable symmetric 1:1 motion has |χ| = (4/π) B/C, and to first order in epsilon |χ| > 1 and |χ - 1| > 1: it lies outside, measured
// from either state.

/// Largest relative error of the half-width in a drawing.
pub const DRAWING: f64 = 0.1;
/// Largest mass ratio of a rig over the ratio in its drawing, whose masses are known within a fifth.
const LARGEST_RATIO: f64 = 1.0 / (1.0 - 0.2);

/// Whether walls must have touched the particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Impacts {
    /// The motion needs them.
    Needed,
    /// A particle that is free or carried, or friction, explains the motion.
    NotNeeded,
    /// The uncertainty is too large to say.
    Doubtful,
}

/// What a distance from the centre of a region without impacts says: beyond `outer` they are needed, within `inner` they are not.
fn beyond(distance: f64, uncertainty: f64, [inner, outer]: [f64; 2]) -> Impacts {
    if distance > outer + SIGNIFICANT * uncertainty {
        Impacts::Needed
    } else if distance <= inner {
        Impacts::NotNeeded
    } else {
        Impacts::Doubtful
    }
}

/// What a motion says of impacts by its frequency and its loss: response, m, base, m, and frequency, rad/s, at the phase `target` of the response
/// relative to the base, rad. `epsilon`: the mass ratio in the drawing.
pub fn impacts_by_resonance(
    linear: &LinearResponse,
    [response, base, omega]: [Estimate; 3],
    target: f64,
    epsilon: f64,
) -> Impacts {
    // Damping and detuning of a linear response of this gain with this response over the base.
    let rate = linear.gain * base.value / Complex64::from_polar(response.value, target);
    let stated = linear.rate(omega.value);
    let added = Complex64::new(0.0, -2.0 / linear.omega0) * (rate - stated);
    let relative = [response, base]
        .map(|one| one.uncertainty / one.value)
        .into_iter()
        .fold(linear.u_gain, f64::hypot);
    let parts = [
        relative * rate.norm(),
        omega.uncertainty,
        linear.uncertainty,
        linear.uncertainty,
    ];
    let uncertainty = Estimate::new(0.0, &parts).uncertainty * 2.0 / linear.omega0;
    // The disc of every particle up to the largest one, added to the state in which the linear response was measured. Of an unknown state, motions without
    // impacts are as far away as the diameter of the disc, and those with impacts as near as `|χ| > 1` and `|χ - 1| > 1` are to `|χ - 1/2| <= 1/2`.
    let nearest = 0.5 * (3_f64.sqrt() - 1.0);
    let (centre, radii) = match linear.particle {
        ParticleState::Free => (0.5, [LARGEST_RATIO - 0.5; 2]),
        ParticleState::Carried => (-0.5, [LARGEST_RATIO - 0.5; 2]),
        ParticleState::Unknown => (0.0, [nearest / LARGEST_RATIO, LARGEST_RATIO]),
    };
    beyond(
        (added - centre * epsilon).norm(),
        uncertainty,
        radii.map(|radius| radius * epsilon),
    )
}

/// What the third harmonic of the structure's motion says of impacts: the force that excites it, over the force of the mass M in the fundamental.
pub fn impacts_by_harmonic(third: Estimate, epsilon: f64) -> Impacts {
    // Of sliding friction it is at most that of a square wave as high as the force that carries the particle.
    let friction = 4.0 / (3.0 * PI) * LARGEST_RATIO * epsilon;
    beyond(third.value, third.uncertainty, [friction; 2])
}

/// Resolution of a stated point: of response and drive, relative, and of the frequency over the half-power bandwidth. No sensor and no drawing shows
/// more.
pub const POINT_RESOLUTION: f64 = 1e-4;

/// Frequency response without impacts, near its resonance: response over base `gain/(damping_rate + i (omega - omega0))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearResponse {
    /// Natural frequency, rad/s.
    pub omega0: f64,
    /// Damping rate, rad/s.
    pub damping_rate: f64,
    /// Standard uncertainty of natural frequency and damping rate, rad/s.
    pub uncertainty: f64,
    /// Growth rate of the response at resonance per amplitude of the base, 1/s, with its phase relative to the base.
    pub gain: Complex64,
    /// Relative standard uncertainty of the gain.
    pub u_gain: f64,
    /// The state of the particle that it belongs to.
    pub particle: ParticleState,
    /// What a shaker makes of its command, if one was measured.
    pub shaker: Option<ShakerPath>,
}

impl LinearResponse {
    /// That of a plant whose particle is free. A base moves the mass through spring and damper.
    pub fn of(plant: &Parameters, reference: Reference) -> Self {
        let (omega0, damping_rate) = (plant.natural_frequency(), 0.5 * plant.damping / plant.primary_mass);
        let through_damper = match reference {
            Reference::Base => 2.0 * damping_rate / omega0,
            Reference::Force => 0.0,
        };
        Self {
            omega0,
            damping_rate,
            uncertainty: 0.0,
            gain: Complex64::new(0.0, -0.5 * omega0) * Complex64::new(1.0, through_damper),
            u_gain: 0.0,
            particle: ParticleState::Free,
            shaker: None,
        }
    }

    /// Natural frequency and damping ratio as data; both have the same uncertainty, the real and the imaginary part of one rate.
    pub fn data(&self) -> MeasuredLinear {
        MeasuredLinear {
            f0: self.omega0 / TAU,
            u_f0: self.uncertainty / TAU,
            zeta: self.damping_rate / self.omega0,
            u_zeta: self.uncertainty / self.omega0,
            correlation: 0.0,
            particle: self.particle,
        }
    }

    /// Response over base at the frequency `omega`, rad/s.
    pub fn at(&self, omega: f64) -> Complex64 {
        self.gain / Complex64::new(self.damping_rate, omega - self.omega0)
    }

    /// `delta + i (omega - omega_d)`, 1/s, with which the amplitude approaches its steady value under a drive of the frequency `omega`, rad/s.
    pub fn rate(&self, omega: f64) -> Complex64 {
        let free = (self.omega0.powi(2) - self.damping_rate.powi(2)).max(0.0).sqrt();
        Complex64::new(self.damping_rate, omega - free)
    }

    /// This rate times response over base, 1/s, of an oscillator that is moved through its spring and damper, or by the force in them.
    pub fn oscillator_gain(&self, omega: f64, reference: Reference) -> Complex64 {
        let (square, damper) = (self.omega0.powi(2), 2.0 * self.damping_rate * omega);
        let force = match reference {
            Reference::Base => Complex64::new(square, damper),
            Reference::Force => Complex64::from(square * reference.per_base(self.bandwidth())),
        };
        force / (self.rate(-omega).conj())
    }

    /// Half-power bandwidth over omega0: twice the damping ratio, and base over response at resonance.
    pub fn bandwidth(&self) -> f64 {
        2.0 * self.damping_rate.max(0.0) / self.omega0
    }

    /// A point as it is stated: response, m, drive, m, and frequency, rad/s, whose uncertainties contain the resolution of a point.
    pub fn resolved(&self, [response, drive, omega]: [Estimate; 3]) -> [Estimate; 3] {
        let with =
            |Estimate { value, uncertainty }, unit: f64| Estimate::new(value, &[uncertainty, POINT_RESOLUTION * unit]);
        [
            with(response, response.value),
            with(drive, drive.value),
            with(omega, self.bandwidth() * self.omega0),
        ]
    }

    /// The response as it is stated: its uncertainties contain the resolution of a point.
    #[must_use]
    pub fn stated(self) -> Self {
        Self {
            uncertainty: self
                .uncertainty
                .hypot(POINT_RESOLUTION * self.bandwidth() * self.omega0),
            u_gain: self.u_gain.hypot(POINT_RESOLUTION),
            ..self
        }
    }

    /// Natural periods in which the amplitude falls by a factor of e.
    pub fn relaxation_periods(&self) -> f64 {
        1.0 / (PI * self.bandwidth())
    }
}
