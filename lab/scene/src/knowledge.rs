//! What measuring knows of a rig, in SI units: its linear response, what the loop holds, and the numbers by which results become dimensionless.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::cavity::GRAVITY;
use lovines::{Cavity, Parameters};
use num_complex::Complex64;
use vines_model::numerics::{Estimate, mean, noise, noise_at};
use vines_model::{Dimensionless, Measurand, Sensor};
use vines_rig::unit::Quantity;
use vines_rig::{Drive, Sensors};

use crate::filter::LowPass;
use crate::linear::{LinearResponse, MeasuredLinear};
use crate::shaker_path::ShakerPath;
use crate::units::Units;

/// What a loop holds: the phase of the response relative to the reference, both as displacements. The two channels may read velocities and
/// accelerations. The bench divides these by omega0 and omega0², and takes all of them as metres of the oscillator, so that controllers have the same
/// gains and limits for all of them, and shifts the phase that the controller holds. Amplitudes and phases of displacements follow harmonic by harmonic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Phase of the response relative to the reference, rad.
    pub phase: f64,
    /// What response and reference measure.
    pub measurands: [Measurand; 2],
    /// The frequency by which readings are divided, rad/s.
    pub omega0: f64,
    /// A shaker stands between the command and the reference, so that the reference drives the structure as it is measured.
    pub through_shaker: bool,
    /// Cut-off of the anti-alias filter in both channels, rad/s: its gain is known. Its phase cancels, or the controller compensates it as a delay.
    pub filter: Option<f64>,
    /// How late the readings of the response are, s: without a reference, the drive of so long ago is the reference.
    pub delay: f64,
    /// The units of the channels.
    pub units: Units,
    /// The base is held from sample to sample: its fundamental is smaller than that of the samples.
    pub held: bool,
    /// Magnitudes of scaled readings at the end of the range of their converters, as far as the scene states these; otherwise infinite.
    pub ranges: [f64; 2],
}

impl Target {
    /// Displacement per reading of a channel at omega0: 0, the response, or 1, the reference.
    pub fn scale(&self, channel: usize) -> f64 {
        self.omega0.powi(-self.measurands[channel].order())
    }

    /// A reading of a channel in its unit, as a displacement in metres of the oscillator.
    pub fn in_metres(&self, channel: usize, reading: f64) -> f64 {
        let unit = [self.units.response, self.units.reference][channel];
        unit.in_metres(reading) * self.scale(channel)
    }

    /// A scaled reading of a channel, in the unit of the channel: the inverse of [`Target::in_metres`].
    pub fn quantity(&self, channel: usize, scaled: f64) -> Quantity {
        let unit = [self.units.response, self.units.reference][channel];
        Quantity {
            value: unit.of_metres(scaled / self.scale(channel)),
            unit: self.unit(channel),
        }
    }

    /// Symbol of the unit of the readings of a channel.
    pub fn unit(&self, channel: usize) -> &'static str {
        match self.units.reference.symbol {
            "N" if channel == 1 => "N",
            _ => self.measurands[channel].unit(),
        }
    }

    /// Readings in the units of their channels as displacements in metres of the oscillator, as a loop with this target takes them.
    pub fn scaled(&self, sensors: Sensors) -> Sensors {
        Sensors {
            response: self.in_metres(0, sensors.response),
            reference: sensors.reference.map(|value| self.in_metres(1, value)),
        }
    }

    /// Readings in the units of their channels, from [`Target::scaled`].
    pub fn unscaled(&self, sensors: Sensors) -> Sensors {
        let reading = |channel, scaled| self.quantity(channel, scaled).value;
        Sensors {
            response: reading(0, sensors.response),
            reference: sensors.reference.map(|value| reading(1, value)),
        }
    }

    /// The key of the range that scaled readings exceed, if the scene states it: there a converter saturates.
    pub fn saturated(&self, readings: impl IntoIterator<Item = Sensors>) -> Option<&'static str> {
        readings
            .into_iter()
            .find_map(|Sensors { response, reference }| match self.ranges {
                [most, _] if response.abs() >= most => Some("chain.response_range"),
                [_, most] if reference.is_some_and(|value| value.abs() >= most) => Some("chain.base_range"),
                _ => None,
            })
    }

    /// A drive in metres of the oscillator, as the command of a rig.
    pub fn command(&self, drive: Drive) -> Drive {
        drive.map(|metres| self.units.command.of_metres(metres))
    }

    /// The command of a rig, in metres of the oscillator.
    pub fn drive(&self, command: Drive) -> Drive {
        command.map(|value| self.units.command.in_metres(value))
    }

    /// Displacement over the scaled reading of a channel, at a harmonic of the frequency `omega`, rad/s.
    pub fn displacement(&self, channel: usize, omega: f64) -> Complex64 {
        let order = self.measurands[channel].order();
        let turned = [Complex64::ONE, -Complex64::I, -Complex64::ONE][order as usize];
        let passed = self.filter.map_or(1.0, |cut_off| LowPass::gain(cut_off, omega));
        turned * (self.omega0 / omega).powi(order) / passed
    }

    /// Standard deviation of the noise on a smooth signal of a sensor: white, or, behind the filter, as correlated as that makes it.
    pub fn noise(&self, values: &[f64], sample_time: f64) -> f64 {
        let Some(cut_off) = self.filter else {
            return noise(values);
        };
        // Over a quarter of the filter's period most of the correlation is gone.
        let stride = (FRAC_PI_2 / (cut_off * sample_time)).max(1.0).floor();
        let correlation = [1.0, 2.0, 3.0].map(|n| LowPass::correlation(cut_off, n * stride * sample_time));
        noise_at(values, stride as usize, correlation)
    }

    /// Power density of the noise of a sensor at the frequency `omega`, rad/s, over that of white noise with the same variance.
    pub fn colour(&self, omega: f64, sample_time: f64) -> f64 {
        self.filter
            .map_or(1.0, |cut_off| LowPass::colour(cut_off, omega, sample_time))
    }

    /// Power density of the noise at the fundamental, of the frequency `omega`, rad/s, over its mean above this number of harmonics.
    pub fn colour_of_fundamental(&self, omega: f64, sample_time: f64, harmonics: usize) -> f64 {
        let at = |k: usize| self.colour(k as f64 * omega, sample_time);
        let highest = (PI / (omega * sample_time)) as usize;
        match self.filter {
            Some(_) if highest > harmonics => at(1) / mean((harmonics + 1..=highest).map(at)),
            _ => 1.0,
        }
    }

    /// Fundamental of the base over that of its samples, `sample_time` seconds apart, at the frequency `omega`, rad/s.
    pub fn base_per_sample(&self, omega: f64, sample_time: f64) -> f64 {
        let half = 0.5 * omega * sample_time;
        if self.held { half.sin() / half } else { 1.0 }
    }

    /// Amplitude of the scaled response whose displacement has this amplitude, m, at the frequency `omega`, rad/s.
    pub fn reading(&self, amplitude: f64, omega: f64) -> f64 {
        amplitude / self.displacement(0, omega).norm()
    }

    /// Phase of the reading of the response relative to the reading of the reference, rad, from -pi to pi.
    pub fn phase_of_readings(&self) -> f64 {
        let [response, reference] = self.measurands.map(Measurand::lead);
        let phase = self.phase + (response - reference);
        phase - TAU * (phase / TAU).round()
    }
}

/// What measuring knows of a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knowledge {
    /// The linear response.
    pub linear: LinearResponse,
    /// Whether the linear response has been measured on the rig; otherwise it is as the scene states it.
    pub is_measured: bool,
    /// The numbers by which results become dimensionless, with the definition of resonance.
    pub numbers: Dimensionless,
    /// Whether a motion has a mirror image, half a period later; where it has none, the 1:1 motion is asymmetric.
    pub is_symmetric: bool,
    /// Acceleration up to which friction carries the particle, as the drawing says, m/s².
    pub carried_up_to: f64,
    /// Time from sample to sample, s: rig and controller agree on it before anything is measured.
    pub sample_time: f64,
    /// Phase of the response relative to the reference that the loop holds, and what is measured of both.
    pub target: Target,
    /// The shaker, if one stands between the command and the reference, which then drives the structure as it is measured.
    pub shaker: Option<ShakerPath>,
    /// Distance of the nearest other pole of a structure from the pole of its driven mode after the release, rad/s; infinite without one.
    pub nearest_pole: f64,
    /// Poles of the two other modes of a structure that ring longest in the response, rad/s; the longest first.
    pub rings: [Option<Complex64>; 2],
}

impl Knowledge {
    /// The linear response as data, if it was measured on the rig.
    pub fn measured_linear(&self) -> Option<MeasuredLinear> {
        self.is_measured.then(|| self.linear.data())
    }

    /// Growth rate of the response at phase resonance per amplitude of the base, 1/s, at the frequency `omega`, rad/s: k/(2 omega) over the mass that
    /// moves. Of q1 this mass is `k/omega²`, whatever the particle does. Of v it is M, and `omega0` belongs to M and what was carried of m.
    pub fn growth(&self, omega: f64) -> Estimate {
        let (omega0, Dimensionless { epsilon, definition, .. }) = (self.linear.omega0, self.numbers);
        let growth = match definition.sensor {
            Sensor::Q1 => Estimate::new(0.5 * omega, &[]),
            Sensor::V => {
                let [least, most] = self.linear.particle.carried();
                // A uniform distribution.
                let mass = Estimate::new(
                    1.0 + 0.5 * epsilon * (least + most),
                    &[epsilon * (most - least) / 12_f64.sqrt()],
                );
                mass.scaled(0.5 * omega0 * omega0 / omega)
            }
        };
        growth.scaled(definition.reference.per_base(self.linear.bandwidth()))
    }

    /// With a linear response that was measured on the rig.
    #[must_use]
    pub fn measured(self, linear: LinearResponse) -> Self {
        let (omega0, epsilon) = (linear.omega0, self.numbers.epsilon);
        let lambda = 2.0 * linear.damping_rate.max(0.0) / (epsilon * omega0);
        let numbers = Dimensionless { omega0, lambda, ..self.numbers };
        let shaker = linear.shaker.or(self.shaker);
        Self { linear, is_measured: true, numbers, shaker, ..self }
    }

    /// Number of samples in these natural periods.
    pub fn samples(&self, periods: f64) -> usize {
        (periods * TAU / self.linear.omega0 / self.sample_time).round() as usize
    }

    /// Whether the target is phase resonance.
    pub fn is_at_phase_resonance(&self) -> bool {
        self.numbers.definition.is_phase_resonance()
    }
}

/// Acceleration of the structure up to which static friction carries a particle that touches no wall, m/s²; 0 without friction.
pub(crate) fn carried_up_to(plant: &Parameters) -> f64 {
    let Cavity { kinetic_friction, static_friction, tilt, .. } = plant.cavity;
    let held = static_friction.unwrap_or(kinetic_friction) * tilt.cos();
    (GRAVITY * (held - tilt.sin().abs())).max(0.0)
}

/// Whether there is friction in the cavity.
pub fn has_friction(plant: &Parameters) -> bool {
    plant.cavity.kinetic_friction > 0.0 || plant.cavity.static_friction.is_some_and(|held| held > 0.0)
}
