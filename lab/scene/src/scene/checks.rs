//! What is allowed of a scene: the ranges of its keys, one row a key, and the rules that join keys.
//!
//! The first row that refuses is reported, then the first rule: the order of both lists is the order in which they are asked. A limit that follows from
//! another key stands below this key.

use std::f64::consts::TAU;

use lovines::{Drive, Plant, State, StructureState};

use super::controller::in_degrees;
use super::{Measurand, Reference, Scene, SceneError, Sensor, Structure};

/// What is allowed of a number, which must be finite.
pub(super) enum Range {
    Positive,
    NotNegative,
    Within([f64; 2]),
    /// Limits that follow from other keys: whether they allow the value, and what is allowed.
    If(bool, String),
}

/// The value of a key, in its unit, and what is allowed; without a value everything is.
pub(super) struct Row {
    key: &'static str,
    value: Option<f64>,
    unit: &'static str,
    range: Range,
}

impl Row {
    pub(super) fn new(key: &'static str, value: impl Into<Option<f64>>, unit: &'static str, range: Range) -> Self {
        Self { key, value: value.into(), unit, range }
    }

    /// Refuses a value that is not allowed.
    pub(super) fn check(self) -> Result<(), SceneError> {
        let Self { key, value: Some(value), unit, range } = self else {
            return Ok(());
        };
        let (is_allowed, allowed) = match range {
            Range::Positive => (value > 0.0, "must be positive and finite".into()),
            Range::NotNegative => (value >= 0.0, "must be zero or positive, and finite".into()),
            Range::Within([low, high]) => ((low..=high).contains(&value), format!("must be from {low} to {high}")),
            Range::If(is_allowed, allowed) => (is_allowed, allowed),
        };
        match is_allowed && value.is_finite() {
            true => Ok(()),
            false => Err(SceneError::Value { key, value, unit, allowed }),
        }
    }
}

/// Refuses a scene that no bench can run; `origin` names it in messages.
pub(super) fn check(scene: &Scene, origin: &str) -> Result<(), SceneError> {
    ROWS.iter().try_for_each(|row| row(scene).check())?;
    if let Some(message) = RULES.iter().find_map(|rule| rule(scene)) {
        return Err(SceneError::text(origin, message));
    }
    let fastest = scene.controller.omega_max * scene.dimensionless().omega0;
    Drive::harmonic(scene.amplitude, fastest)
        .validate()
        .map_err(SceneError::Drive)
}

// Ranges.

use Range::{If, NotNegative, Positive, Within};

/// Rows of a scene: key = value, unit, what is allowed.
macro_rules! rows {
    ($scene:ident: $($key:literal = $value:expr, $unit:expr, $range:expr;)*) => {
        &[$(|$scene| Row::new($key, $value, $unit, $range)),*]
    };
}

/// The keys of all sections with numbers of their own. (The plant has a table of its own, and so has the controller.)
const ROWS: &[fn(&Scene) -> Row] = rows! { s:
    "controller.omega_min" = s.controller.omega_min, "(omega0)", Positive;
    "controller.omega_max" = s.controller.omega_max, "(omega0)", above_omega_min(s);
    "controller.samples_per_period" = s.controller.samples_per_period, "(samples)",
        Within([s.controller.fewest_samples(), 1e5]);
    "controller.bandwidth" = s.controller.bandwidth, "(omega0)", as_sampled(s);
    "controller.phase_target" = s.controller.phase_target, "degrees", in_degrees(s.controller.phase_target);
    "backbone.C_from" = s.backbone.c_from, "(over b)", Positive;
    "backbone.C_to" = s.backbone.c_to, "(over b)", Positive;
    "backbone.precision" = s.backbone.precision, "(relative)", Positive;
    "backbone.points" = f64::from(s.backbone.points), "(levels)", Within([1.0, 1e4]);
    // At least enough to count impacts and measure.
    "record.hold_periods" = s.record.hold_periods, "(natural periods)", Within([3.0, 1e6]);
    "record.decay_periods" = s.record.decay_periods, "(natural periods)", Positive;
    // About 3 GiB in memory.
    "samples of phase_lock.acquire_timeout and of all periods of [record]" = samples_of_record(s), "samples",
        If(samples_of_record(s) <= 2e7, "must be at most 20 million".into());
    "chain.adc_bits" = s.chain.adc_bits.map(f64::from), "bits", Within([1.0, 32.0]);
    "chain.dac_bits" = s.chain.dac_bits.map(f64::from), "bits", Within([1.0, 32.0]);
    "chain.dac_bits" = s.chain.dac_bits.map(f64::from), "bits",
        If(s.chain.hold, "needs chain.hold = true: only samples of the drive can be quantised".into());
    "chain.response_range" = s.chain.response_range, "(over b)", Positive;
    "chain.base_range" = s.chain.base_range, "(over b epsilon)", Positive;
    "chain.base_range" = s.chain.base_range, "(over b epsilon)", above_drive(s);
    "chain.snr" = s.chain.snr, "dB", Within([-40.0, 300.0]);
    "chain.response_noise" = s.chain.response_noise, s.reading_units()[0], NotNegative;
    "chain.reference_noise" = s.chain.reference_noise, s.reading_units()[1], NotNegative;
    "chain.reference_noise" = s.chain.reference_noise, s.reading_units()[1],
        If(s.chain.reference, "needs chain.reference = true: no sensor reads the reference".into());
    // Up to half the sampling frequency.
    "chain.filter" = s.chain.filter, "(omega0)", Within([2.0, 0.5 * s.controller.samples_per_period]);
    "chain.jitter" = s.chain.jitter, "samples", Within([0.0, 0.1]);
    "chain.delay" = f64::from(s.chain.delay), "samples", as_detected(s);
};

fn above_omega_min(scene: &Scene) -> Range {
    let [low, high] = [scene.controller.omega_min, scene.controller.omega_max];
    If(high > low, format!("must be above omega_min = {low}"))
}

fn as_sampled(scene: &Scene) -> Range {
    let (samples, widest) = (scene.controller.samples_per_period, scene.controller.bandwidth_max());
    let allowed = format!("must be above 0 and at most {widest:.3} with {samples} samples per period");
    let bandwidth = scene.controller.bandwidth;
    If(bandwidth > 0.0 && bandwidth <= widest, allowed)
}

fn samples_of_record(scene: &Scene) -> f64 {
    let periods = scene.record.hold_periods + scene.record.decay_periods.unwrap_or(0.0);
    let longest = scene
        .lock_config(&scene.knowledge())
        .acquire_timeout
        .unwrap_or(f64::INFINITY);
    (longest / scene.sample_time()).round() + scene.controller.samples_per_period * periods
}

fn above_drive(scene: &Scene) -> Range {
    let drive = scene.dimensionless().g;
    let allowed = format!("must be at least G = {drive:.6}, or the converter of the base saturates");
    If(scene.amplitude <= scene.drive_range(), allowed)
}

/// As the controller checks it; here the keys of a scene are at hand.
fn as_detected(scene: &Scene) -> Range {
    let bandwidth = scene.controller.bandwidth;
    let longest = scene.controller.samples_per_period / (TAU * bandwidth);
    let allowed = format!(
        "must be at most {longest:.0}: the detector of the bandwidth {bandwidth} omega0 lags by as much; lower controller.bandwidth"
    );
    If(f64::from(scene.chain.delay) <= longest, allowed)
}

// Rules.

/// What joins keys of several sections: why a scene is refused, and what to do.
const RULES: [fn(&Scene) -> Option<String>; 8] = [
    mode_without_cavity,
    start_beyond_structure,
    second_reference,
    shaker_without_reference,
    drive_beyond_shaker,
    force_without_sensor,
    quantity_of_v,
    quantity_of_reference,
];

/// No impact moves a mode whose node is at the cavity.
fn mode_without_cavity(scene: &Scene) -> Option<String> {
    let structure = scene.structure.as_ref()?;
    let error = structure.reached_by(scene.plant.particle_mass).err()?;
    Some(format!("[structure]: {error}"))
}

/// The plant takes the structure with the particle at its start.
fn start_beyond_structure(scene: &Scene) -> Option<String> {
    let structure = scene.structure.as_ref()?;
    let State { q2, dq2, .. } = scene.start;
    let start = StructureState { q2, dq2, ..StructureState::default() };
    let error = Plant::with_host(structure.host.clone(), scene.plant, &start).err()?;
    Some(format!("[structure]: {error}"))
}

/// The reference of a structure is what excites it.
fn second_reference(scene: &Scene) -> Option<String> {
    let is_second = scene.structure.is_some() && scene.resonance.reference == Reference::Force;
    is_second.then(|| {
        "resonance.reference = \"force\" beside [structure]: its `excitation` is the reference; drop the key".into()
    })
}

/// The phase of a shaker's command turns near the resonance.
fn shaker_without_reference(scene: &Scene) -> Option<String> {
    if scene.chain.reference {
        return None;
    }
    let turn = scene.structure.as_ref()?.shaker_path()?.turn().to_degrees();
    Some(format!(
        "[shaker] with chain.reference = false: the drive's phase turns by {turn:.1} degrees within the half-power bandwidth; the loop \
         needs the force cell, or the sensor of the table, as its reference"
    ))
}

/// The limits of a shaker allow the drive at the least response at which particles hit: half of the cavity.
fn drive_beyond_shaker(scene: &Scene) -> Option<String> {
    let structure = scene.structure.as_ref()?;
    structure.beyond_limits(scene.amplitude, 0.5 * scene.plant.half_width)
}

/// A force of spring and damper is calculated from what the base sensor reads.
fn force_without_sensor(scene: &Scene) -> Option<String> {
    let is_unread = scene.resonance.reference == Reference::Force && !scene.chain.reference;
    is_unread.then(|| {
        "resonance.reference = \"force\" with chain.reference = false: the force k e + c e' follows from the base \
         sensor; switch it on, or take the reference \"base\""
            .into()
    })
}

/// The name of a quantity other than the displacement.
fn derivative(quantity: Measurand) -> Option<&'static str> {
    (quantity != Measurand::Displacement).then(|| quantity.name())
}

/// No sensor on the structure reads what contains the particle.
fn quantity_of_v(scene: &Scene) -> Option<String> {
    let name = derivative(scene.resonance.sensor_quantity)?;
    (scene.resonance.sensor == Sensor::V).then(|| {
        format!(
            "resonance.sensor_quantity = \"{name}\" with resonance.sensor = \"v\": v contains the particle, which no sensor on the structure \
             reads; set resonance.sensor = \"q1\""
        )
    })
}

/// Only the sensor of a base reads a velocity or an acceleration.
fn quantity_of_reference(scene: &Scene) -> Option<String> {
    let name = derivative(scene.resonance.reference_quantity)?;
    let is_force = |one: &Structure| one.excitation == Reference::Force;
    let reason = if scene.resonance.reference == Reference::Force {
        "with resonance.reference = \"force\": the force k e + c e' follows from the displacement of the base; take the reference \"base\", or the \
         quantity \"displacement\""
    } else if scene.structure.as_ref().is_some_and(is_force) {
        "where a force drives the structure: the reference is this force; drop the key, which belongs to a base"
    } else if !scene.chain.reference {
        "with chain.reference = false: no sensor reads the base, and the reference is the displacement that is commanded; drop one of the keys"
    } else {
        return None;
    };
    Some(format!("resonance.reference_quantity = \"{name}\" {reason}"))
}
