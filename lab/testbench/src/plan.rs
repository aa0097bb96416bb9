//! What an experiment knows and does, in SI units: made from a scene, and from what was measured on the rig before. A scene does not change.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::Section;
use nalgebra::RowVector2;
use num_complex::Complex64;
use phase_lock::Config;
use vines_model::numerics::{Estimate, complex_fit, mean, noise, noise_at};
use vines_model::{Reference, Sensor};

use crate::experiment::DECAYED;
use crate::linear::{MeasuredLinear, ParticleState};
use crate::rig::{LowPass, Sensors};
use crate::scene::{
    Definition, Dimensionless, Excitation, Measurand, Parameters, Scene, Structure, carried_up_to, has_mirror_images,
};

/// Resolution of a stated point: of response and drive, relative, and of the frequency over the half-power bandwidth. No sensor and no drawing shows
/// more.
const RESOLUTION: f64 = 1e-4;

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
    /// That of a plant whose particle is free.
    pub fn of(plant: &Parameters) -> Self {
        let omega0 = plant.natural_frequency();
        Self {
            omega0,
            damping_rate: 0.5 * plant.damping / plant.primary_mass,
            uncertainty: 0.0,
            gain: Complex64::new(0.0, -0.5 * omega0),
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
    pub(crate) fn rate(&self, omega: f64) -> Complex64 {
        let free = (self.omega0.powi(2) - self.damping_rate.powi(2)).max(0.0).sqrt();
        Complex64::new(self.damping_rate, omega - free)
    }

    /// This rate times response over base, 1/s, of an oscillator that is moved through its spring and damper, or by the force in them.
    pub(crate) fn oscillator_gain(&self, omega: f64, reference: Reference) -> Complex64 {
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

    /// A point as it is stated: response, m, drive, m, and frequency, rad/s, whose uncertainties contain [`RESOLUTION`].
    pub(crate) fn resolved(&self, [response, drive, omega]: [Estimate; 3]) -> [Estimate; 3] {
        let with = |Estimate { value, uncertainty }, unit: f64| Estimate::new(value, &[uncertainty, RESOLUTION * unit]);
        [
            with(response, response.value),
            with(drive, drive.value),
            with(omega, self.bandwidth() * self.omega0),
        ]
    }

    /// Natural periods in which the amplitude falls by a factor of e.
    pub fn relaxation_periods(&self) -> f64 {
        1.0 / (PI * self.bandwidth())
    }
}

/// What a loop holds: the phase of the response relative to the reference, both as displacements. The two channels may read velocities and
/// accelerations. The bench divides these by omega0 and omega0², so that controllers have the same gains and limits for all of them, and shifts
/// the phase that the controller holds. Amplitudes and phases of displacements follow harmonic by harmonic.
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
    /// The base is held from sample to sample: its fundamental is smaller than that of the samples.
    pub held: bool,
}

impl Target {
    /// Metres per reading of a channel: 0, the response, or 1, the reference.
    pub(crate) fn scale(&self, channel: usize) -> f64 {
        self.omega0.powi(-self.measurands[channel].order())
    }

    /// What sensors read, in m.
    pub fn scaled(&self, read: Sensors) -> Sensors {
        Sensors {
            response: read.response * self.scale(0),
            reference: read.reference.map(|value| value * self.scale(1)),
        }
    }

    /// What sensors read, in SI units, from [`Target::scaled`].
    pub fn unscaled(&self, read: Sensors) -> Sensors {
        Sensors {
            response: read.response / self.scale(0),
            reference: read.reference.map(|value| value / self.scale(1)),
        }
    }

    /// Displacement over the scaled reading of a channel, at a harmonic of the frequency `omega`, rad/s.
    pub fn displacement(&self, channel: usize, omega: f64) -> Complex64 {
        let order = self.measurands[channel].order();
        let turned = [Complex64::ONE, -Complex64::I, -Complex64::ONE][order as usize];
        let passed = self.filter.map_or(1.0, |cut_off| LowPass::gain(cut_off, omega));
        turned * (self.omega0 / omega).powi(order) / passed
    }

    /// Standard deviation of the noise on a smooth signal of a sensor: white, or, behind the filter, as correlated as that makes it.
    pub(crate) fn noise(&self, values: &[f64], sample_time: f64) -> f64 {
        let Some(cut_off) = self.filter else {
            return noise(values);
        };
        // Over a quarter of the filter's period most of the correlation is gone.
        let stride = (FRAC_PI_2 / (cut_off * sample_time)).max(1.0).floor();
        let correlation = [1.0, 2.0, 3.0].map(|n| LowPass::correlation(cut_off, n * stride * sample_time));
        noise_at(values, stride as usize, correlation)
    }

    /// Power density of the noise of a sensor at the frequency `omega`, rad/s, over that of white noise with the same variance.
    pub(crate) fn colour(&self, omega: f64, sample_time: f64) -> f64 {
        self.filter
            .map_or(1.0, |cut_off| LowPass::colour(cut_off, omega, sample_time))
    }

    /// Power density of the noise at the fundamental, of the frequency `omega`, rad/s, over its mean above this number of harmonics.
    pub(crate) fn colour_of_fundamental(&self, omega: f64, sample_time: f64, harmonics: usize) -> f64 {
        let at = |k: usize| self.colour(k as f64 * omega, sample_time);
        let highest = (PI / (omega * sample_time)) as usize;
        match self.filter {
            Some(_) if highest > harmonics => at(1) / mean((harmonics + 1..=highest).map(at)),
            _ => 1.0,
        }
    }

    /// Fundamental of the base over that of its samples, `sample_time` seconds apart, at the frequency `omega`, rad/s.
    pub(crate) fn base_per_sample(&self, omega: f64, sample_time: f64) -> f64 {
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

/// What a shaker makes of its command near the natural frequency, without impacts: reference over command is `gain (s + d)/(s + pole)`, where
/// `s = i (omega - omega0)`, d is the damping rate of the structure, and amplitudes are those of the bench, in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShakerPath {
    /// Reference per command of a structure that does not move.
    pub gain: Complex64,
    /// Rate, rad/s, with which the response of structure and shaker settles.
    pub pole: Complex64,
    /// Damping rate of the structure, rad/s.
    pub damping_rate: f64,
    /// Whether the reference is a force, and not the displacement of a table.
    pub by_force: bool,
    /// Largest command, m; infinite without a limit.
    pub largest: f64,
    /// Bandwidths of the control of the reference, over those without another resonance of structure and shaker.
    pub speed: f64,
    /// Base displacement per reference, m/N or m/m.
    pub base_per_reference: f64,
    /// Base displacement per command, m/V, as the bench converts commands.
    pub base_per_command: f64,
    /// Periods within which the control follows a change of the response.
    pub followed: usize,
    /// Largest amplitude, m, by which harmonics of the force beside the sampling frequency change its fundamental as it is read.
    pub aliased: f64,
}

impl ShakerPath {
    /// Least squares of the relative errors of reference over command at some frequencies, rad/s, for a structure with this natural frequency
    /// and damping rate, rad/s.
    pub(crate) fn fitted(self, omega0: f64, damping_rate: f64, values: &[(f64, Complex64)]) -> Self {
        let rows = values.iter().map(|(omega, value)| {
            let s = Complex64::new(0.0, omega - omega0);
            let row = RowVector2::new(s, Complex64::ONE) * (value / (s + damping_rate));
            (row, Complex64::ONE)
        });
        let [inverse, of_pole] = complex_fit(rows).map_or([Complex64::ONE; 2], |(found, _)| found.into());
        Self {
            gain: 1.0 / inverse,
            pole: of_pole / inverse,
            damping_rate,
            ..self
        }
    }

    /// Largest relative error of reference over command at these frequencies.
    pub(crate) fn error(&self, omega0: f64, values: &[(f64, Complex64)]) -> f64 {
        let error = |(omega, value): &(f64, Complex64)| (value / self.at(omega - omega0) - 1.0).norm();
        values.iter().map(error).fold(0.0, f64::max)
    }

    /// Reference over command at `omega0 + detuning`, rad/s.
    pub fn at(&self, detuning: f64) -> Complex64 {
        let s = Complex64::new(0.0, detuning);
        self.gain * (s + self.damping_rate) / (s + self.pole)
    }

    /// What is left of the reference at the natural frequency: the drop-out.
    pub fn drop_out(&self) -> f64 {
        self.damping_rate / self.pole.norm()
    }

    /// Phase by which the reference turns within the half-power bandwidth, rad.
    pub fn turn(&self) -> f64 {
        (self.at(self.damping_rate) * self.at(-self.damping_rate).conj()).arg()
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
    /// Base displacement per newton of a structure that a force drives, m/N.
    pub base_per_newton: Option<f64>,
    /// The shaker, if one stands between the command and the reference, which then drives the structure as it is measured.
    pub shaker: Option<ShakerPath>,
    /// Distance of the nearest other pole of a structure from the pole of its driven mode after the release, rad/s; infinite without one.
    pub nearest_pole: f64,
    /// Periods in which what rings beside the driven mode of a structure falls by a factor of e; 0 without it.
    pub ringing: f64,
}

impl Knowledge {
    /// A rig that is as its drawing says.
    pub fn of(plant: &Parameters, definition: Definition, amplitude: f64, sample_time: f64) -> Self {
        let linear = LinearResponse::of(plant);
        let target = Target {
            phase: definition.phase,
            measurands: definition.measurands(),
            omega0: linear.omega0,
            through_shaker: false,
            filter: None,
            delay: 0.0,
            held: false,
        };
        Self {
            linear,
            is_measured: false,
            numbers: Dimensionless { definition, ..Dimensionless::of(plant, amplitude) },
            is_symmetric: has_mirror_images(plant),
            carried_up_to: carried_up_to(plant),
            sample_time,
            target,
            base_per_newton: None,
            shaker: None,
            nearest_pole: f64::INFINITY,
            ringing: 0.0,
        }
    }

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

/// An experiment on a rig: what is known of it, and what is done.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What is known of the rig.
    pub knowledge: Knowledge,
    /// What a structure adds to the response of its driven mode: all sections, and this mode with the opposite sign, each with the weights of its state
    /// in the response per unit of the base. Empty for one oscillator, and behind a shaker.
    pub beside: Vec<(Section, [f64; 2])>,
    /// Requested amplitude of the base, m.
    pub amplitude: f64,
    /// Configuration of the controller for the lock; its limits guard the rig whatever controls it.
    pub lock: Config,
    /// Configuration of the controller for the tracked backbone.
    pub tracking: Config,
    /// Samples of the hold.
    pub hold: usize,
    /// Longest ramp of the drive after the controller was asked to release it, samples: in this time the response of the linear rig falls to
    /// 5 % (where a decay counts as over), so that after a longer ramp nothing is left to decay.
    pub ramp: usize,
    /// Samples of the recorded decay.
    pub decay: usize,
    /// Levels of the tracked backbone, amplitudes of the response, m, in the order in which they are visited.
    pub levels: Vec<f64>,
    /// Largest relative uncertainty of a level, as in [`BackboneSettings`](crate::scene::BackboneSettings).
    pub precision: f64,
    /// The units of the scene.
    pub units: Units,
}

/// In which units a scene gives limits: those of the drive and of the displacement at the sensor, where the bench has the metres of an oscillator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// Drive of the scene per metre of the bench.
    pub drive: f64,
    /// Unit of this drive, m or N.
    pub name: &'static str,
    /// Displacement at the sensor per metre of the bench.
    pub response: f64,
}

impl Plan {
    /// Requested amplitude of the base, m, as it moves with the frequency `omega`, rad/s: a held base moves a little less than its samples.
    pub fn requested(&self, omega: f64) -> f64 {
        self.amplitude * self.knowledge.target.base_per_sample(omega, self.knowledge.sample_time)
    }
}

/// Longest recorded decay, natural periods, unless the scene asks for a longer one: a bound for rigs with little damping.
const LONGEST_DECAY: f64 = 5000.0;

impl Scene {
    /// What the scene says of its rig.
    pub fn knowledge(&self) -> Knowledge {
        let mut knowledge = Knowledge::of(&self.plant, self.definition(), self.amplitude, self.sample_time());
        knowledge.shaker = self.structure.as_ref().and_then(|structure| structure.shaker_path());
        if let Some(path) = &mut knowledge.shaker {
            path.aliased = self.aliased(1.0).unwrap_or(0.0);
        }
        knowledge.target.through_shaker = knowledge.shaker.is_some();
        let forced = self
            .structure
            .as_ref()
            .filter(|one| one.excitation == Excitation::Force);
        knowledge.base_per_newton = forced.map(Structure::base_per_drive);
        knowledge.nearest_pole = self.structure.as_ref().map_or(f64::INFINITY, Structure::nearest_pole);
        knowledge.ringing = self.structure.as_ref().map_or(0.0, Structure::ringing);
        knowledge.target.held = self.chain.hold;
        knowledge.target.filter = self.chain.filter.map(|cut_off| cut_off * knowledge.linear.omega0);
        knowledge
    }

    /// The experiment on a rig that is as the scene says.
    pub fn plan(&self) -> Plan {
        self.plan_on(self.knowledge())
    }

    /// The experiment on a rig of which this is known.
    pub fn plan_on(&self, mut knowledge: Knowledge) -> Plan {
        // The decay lasts as long as the linear rig takes to fall to the share that is recorded.
        let relaxed = (-DECAYED.ln() * knowledge.linear.relaxation_periods()).min(LONGEST_DECAY);
        let decay = self.record.decay_periods.unwrap_or(relaxed);
        let structure = self.structure.as_ref().filter(|one| one.shaker.is_none());
        let lock = self.lock_config(&knowledge);
        knowledge.target.delay = lock.delay;
        Plan {
            knowledge,
            beside: structure.map_or(Vec::new(), Structure::beside_driven_mode),
            amplitude: self.amplitude,
            lock,
            tracking: self.tracking_config(&knowledge),
            hold: knowledge.samples(self.record.hold_periods),
            ramp: knowledge.samples(relaxed),
            decay: knowledge.samples(decay),
            levels: self.backbone.levels(self.plant.half_width),
            precision: self.backbone.precision,
            units: self.units(),
        }
    }
}
