//! A simulated rig with a fault, for rehearsals: a sensor, the shaker, the structure or the clock fails after some rig time.

use std::collections::VecDeque;

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use super::chain::normal;
use super::{Chain, Drive, Rig, RigError, Sensors, SensorsOnly, ShakerFault, Simulated};
use vines_scene::scene::Scene;

/// What fails in a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigFault {
    /// The response sensor.
    Response(SensorFault),
    /// The sensor of the base.
    Base(SensorFault),
    /// Both sensors at once.
    Both(SensorFault),
    /// Response and base are exchanged.
    Swapped,
    /// The drive that reaches the rig is this many times the one asked for.
    Shaker(f64),
    /// The natural frequency rises by a tenth.
    Structure,
    /// The rig's clock jumps forward by this many hundredths of a natural period.
    Forward(usize),
    /// The electrodynamic shaker of a scene that has one.
    Electrodynamic(ShakerFault),
}

/// How a sensor fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SensorFault {
    /// Reads zero.
    Dead,
    /// Reads the last value.
    Frozen,
    /// Reads the opposite sign.
    Reversed,
    /// Saturates at half of the largest value before the fault, or so far if it begins with the motion.
    Saturated,
    /// Reads the end of its range, a displacement of 2 b.
    Stuck,
    /// Reads this many times the value.
    Gain(f64),
    /// An offset of one amplitude is added.
    Offset,
    /// Noise with the RMS of the signal is added.
    Noisy,
    /// Reads zero for five of every ten samples.
    Loose,
    /// Reads this value, in the unit of the channel.
    Value(f64),
    /// Reads the value of this many hundredths of a natural period ago.
    Late(usize),
}

impl RigFault {
    /// The faults by name, as `vines rig --fault` takes them.
    pub const ALL: [(&'static str, Self); 27] = {
        use RigFault::*;
        use SensorFault::*;
        [
            ("response sensor dead", Response(Dead)),
            ("response sensor frozen", Response(Frozen)),
            ("response sensor reversed", Response(Reversed)),
            ("response sensor saturated at half", Response(Saturated)),
            ("response sensor at the end of its range", Response(Stuck)),
            ("response sensor × 3", Response(Gain(3.0))),
            ("response sensor × 0.3", Response(Gain(0.3))),
            ("response sensor with an offset", Response(Offset)),
            ("response sensor noisy", Response(Noisy)),
            ("response sensor loose", Response(Loose)),
            ("response sensor late", Response(Late(25))),
            ("response NaN", Response(Value(f64::NAN))),
            ("response infinite", Response(Value(f64::INFINITY))),
            ("base sensor dead", Base(Dead)),
            ("base sensor frozen", Base(Frozen)),
            ("base sensor reversed", Base(Reversed)),
            ("base sensor saturated at half", Base(Saturated)),
            ("base sensor noisy", Base(Noisy)),
            ("base sensor late", Base(Late(25))),
            ("base NaN", Base(Value(f64::NAN))),
            ("sensors swapped", Swapped),
            ("both sensors frozen (clock stands still)", Both(Frozen)),
            ("clock jumps back", Both(Late(37))),
            ("clock jumps forward", Forward(37)),
            ("shaker off", Shaker(0.0)),
            ("shaker × 5 (overload)", Shaker(5.0)),
            ("structure changes (lost lock)", Structure),
        ]
    };

    /// Those of a scene with a shaker, beside the faults of its sensors.
    pub const OF_SHAKER: [(&'static str, Self); 3] = [
        ("stinger breaks", Self::Electrodynamic(ShakerFault::StingerBreaks)),
        ("amplifier clips", Self::Electrodynamic(ShakerFault::AmplifierClips)),
        ("armature at its stop", Self::Electrodynamic(ShakerFault::AtStop)),
    ];
}

/// Healthy readings that are kept, in hundredths of a natural period: more than one period.
const READINGS_KEPT: usize = 128;

/// The plant of a scene, whose sensors, shaker, structure or clock fail.
struct Faulty {
    rig: Box<dyn Rig>,
    /// The rig with the changed structure, under the same drive.
    changed: Option<Box<dyn Rig>>,
    fault: RigFault,
    sample_time: f64,
    /// End of the ranges of response and base.
    range: [f64; 2],
    /// Largest value of the channel before the fault.
    before: Option<f64>,
    samples_per_period: f64,
    /// Samples that the rig was advanced before the fault begins, and until now.
    begins: usize,
    taken: usize,
    /// Samples until the last drive that was not zero.
    driven: usize,
    /// Healthy readings of response and base, the newest last.
    past: VecDeque<[f64; 2]>,
    random: ChaCha8Rng,
    ended: Box<dyn FnMut(Option<f64>)>,
}

/// The rig of a scene for a rehearsal: read by the scene's measurement chain, without ground truth, and with a fault that begins after
/// `seconds` of rig time. When the rig is dropped after that, `ended` gets the time from the fault to a drive of zero, s, or `None` if
/// the last drive was not zero.
///
/// # Errors
/// A plant or a start that is not allowed.
pub fn faulty(
    scene: &Scene,
    fault: RigFault,
    seconds: f64,
    ended: impl FnMut(Option<f64>) + 'static,
) -> Result<SensorsOnly, RigError> {
    let of_shaker = match fault {
        RigFault::Electrodynamic(fault) => Some((fault, seconds)),
        _ => None,
    };
    // A natural frequency that is a tenth higher.
    let mut stiffer = scene.clone();
    stiffer.plant.stiffness *= 1.21;
    let changed = (fault == RigFault::Structure).then(|| Simulated::failing(&stiffer, None));
    let (begins, units) = ((seconds / scene.sample_time()) as usize, scene.units());
    let rig = Faulty {
        rig: Simulated::failing(scene, of_shaker)?,
        changed: changed.transpose()?,
        fault,
        sample_time: scene.sample_time(),
        range: [units.response, units.reference].map(|unit| unit.of_metres(2.0 * scene.plant.half_width)),
        before: None,
        samples_per_period: scene.controller.samples_per_period,
        begins,
        taken: 0,
        driven: begins,
        past: VecDeque::new(),
        random: ChaCha8Rng::seed_from_u64(1),
        ended: Box::new(ended),
    };
    Ok(SensorsOnly(Chain::around(Box::new(rig), scene)))
}

impl Faulty {
    /// Samples since the fault began.
    fn elapsed(&self) -> Option<usize> {
        self.taken.checked_sub(self.begins)
    }

    /// Samples in hundredths of a natural period.
    fn samples(&self, hundredths: usize) -> usize {
        (0.01 * self.samples_per_period * hundredths as f64).round() as usize
    }

    /// The reading, m, of a channel whose sensor fails.
    fn read(&mut self, channel: usize, sensor: SensorFault, elapsed: usize) -> f64 {
        let kept = self.past.len();
        let ago = |samples: usize| self.past[kept.saturating_sub(1 + samples)][channel];
        let largest = self
            .past
            .iter()
            .fold(0.0_f64, |most, past| most.max(past[channel].abs()));
        let value = ago(0);
        match sensor {
            SensorFault::Dead => 0.0,
            SensorFault::Frozen => ago(elapsed + 1),
            SensorFault::Reversed => -value,
            SensorFault::Saturated => {
                // A fault from the start meets no motion yet.
                let level = if self.begins < self.samples(READINGS_KEPT) {
                    largest
                } else {
                    *self.before.get_or_insert(largest)
                };
                value.clamp(-0.5 * level, 0.5 * level)
            }
            SensorFault::Stuck => self.range[channel],
            SensorFault::Gain(gain) => gain * value,
            SensorFault::Offset => value + largest,
            SensorFault::Noisy => value + largest * std::f64::consts::FRAC_1_SQRT_2 * normal(&mut self.random),
            SensorFault::Loose if elapsed % 10 < 5 => 0.0,
            SensorFault::Loose => value,
            SensorFault::Value(value) => value,
            SensorFault::Late(hundredths) => ago(self.samples(hundredths)),
        }
    }
}

impl Rig for Faulty {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let elapsed = self.elapsed();
        let changed = self.changed.as_mut().filter(|_| elapsed.is_some());
        let mut sensors = changed.unwrap_or(&mut self.rig).sense()?;
        self.past
            .push_back([sensors.response, sensors.reference.unwrap_or(0.0)]);
        if self.past.len() > self.samples(READINGS_KEPT) + elapsed.unwrap_or(0) {
            self.past.pop_front();
        }
        let Some(elapsed) = elapsed else {
            return Ok(sensors);
        };
        let Sensors { response, reference } = &mut sensors;
        match self.fault {
            RigFault::Response(sensor) => *response = self.read(0, sensor, elapsed),
            RigFault::Base(sensor) => *reference = Some(self.read(1, sensor, elapsed)),
            RigFault::Both(sensor) => {
                *response = self.read(0, sensor, elapsed);
                *reference = Some(self.read(1, sensor, elapsed));
            }
            RigFault::Swapped => (*response, *reference) = (reference.unwrap_or(0.0), Some(*response)),
            RigFault::Shaker(_) | RigFault::Structure | RigFault::Forward(_) | RigFault::Electrodynamic(_) => {}
        }
        Ok(sensors)
    }

    fn advance(&mut self, mut drive: Drive, step: f64) -> Result<(), RigError> {
        let elapsed = self.elapsed();
        self.taken += 1;
        let asked = if drive.is_held {
            drive.displacement
        } else {
            drive.amplitude
        };
        if asked != 0.0 {
            self.driven = self.driven.max(self.taken);
        }
        if let Some(changed) = &mut self.changed {
            changed.advance(drive, step)?;
        }
        match (self.fault, elapsed) {
            (RigFault::Forward(hundredths), Some(0)) => {
                for _ in 0..self.samples(hundredths) {
                    self.rig.advance(drive, step)?;
                }
            }
            (RigFault::Shaker(gain), Some(_)) => drive = drive.map(|value| gain * value),
            _ => {}
        }
        self.rig.advance(drive, step)
    }
}

impl Drop for Faulty {
    fn drop(&mut self) {
        if self.elapsed().is_some() {
            let samples = (self.driven < self.taken).then(|| self.driven - self.begins);
            (self.ended)(samples.map(|samples| samples as f64 * self.sample_time));
        }
    }
}
