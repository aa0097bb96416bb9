//! The measurement chain around any rig: from the motion to the samples that the controller reads, and from the controller's
//! output to the base.
//!
//! An input passes sensor noise, anti-alias filter, converter and delay, in that order. The output is held from sample to sample
//! and quantised. `[chain]` in the scene switches each stage on.

mod converter;
mod filter;
mod noise;

use std::collections::VecDeque;

use converter::Converter;
use filter::LowPass;
pub(super) use noise::NormalDistribution;
use noise::Sensor;

use super::{Drive, GroundTruth, Rig, RigError, Sensors};
use crate::scene::Scene;

/// Largest deviation of a sampling instant, in standard deviations.
const JITTER_MAX: f64 = 4.0;

/// A rig behind its measurement chain.
pub struct Chain {
    rig: Box<dyn Rig>,
    response: Channel,
    base: Option<Channel>,
    /// For an output that is held: its converter, unless that is ideal.
    output: Option<Option<Converter>>,
    normal: NormalDistribution,
    /// Standard deviation of the sampling instants, in samples.
    jitter: f64,
    /// Delay of the present sampling instant relative to its nominal time, in samples.
    late: f64,
    /// Delayed readings; the oldest is returned next.
    under_way: VecDeque<Sensors>,
    /// Time since the last reading, s.
    elapsed: f64,
}

/// The stages of one input.
struct Channel {
    sensor: Option<Sensor>,
    filter: Option<LowPass>,
    converter: Option<Converter>,
}

impl Channel {
    fn read(&mut self, value: f64, elapsed: f64, normal: &mut NormalDistribution) -> f64 {
        let noisy = match &mut self.sensor {
            Some(sensor) => sensor.read(value, normal),
            None => value,
        };
        let filtered = match &mut self.filter {
            Some(filter) => filter.pass(noisy, elapsed),
            None => noisy,
        };
        converted(self.converter.as_ref(), filtered)
    }
}

/// The value behind a converter, if there is one.
fn converted(converter: Option<&Converter>, value: f64) -> f64 {
    converter.map_or(value, |converter| converter.convert(value))
}

impl Chain {
    /// The rig behind its chain, or the rig itself where the chain is off.
    pub fn around(rig: Box<dyn Rig>, scene: &Scene) -> Box<dyn Rig> {
        if scene.chain.is_on() {
            Box::new(Self::new(rig, scene))
        } else {
            rig
        }
    }

    /// The chain of a scene around `rig`.
    pub fn new(rig: Box<dyn Rig>, scene: &Scene) -> Self {
        let (settings, d) = (&scene.chain, scene.dimensionless());
        // The power of a signal is averaged over about one period.
        let channel = |range: f64| Channel {
            sensor: settings
                .snr
                .map(|snr| Sensor::new(snr, settings.snr_of, range, scene.controller.samples_per_period)),
            filter: settings.filter.map(|cut_off| LowPass::new(cut_off * d.omega0)),
            converter: settings.adc_bits.map(|bits| Converter::new(bits, range)),
        };
        let base_range = d.amplitude(settings.base_range);
        Self {
            rig,
            response: channel(settings.response_range * d.b),
            base: settings.reference.then(|| channel(base_range)),
            output: settings
                .hold
                .then(|| settings.dac_bits.map(|bits| Converter::new(bits, base_range))),
            normal: NormalDistribution::new(settings.seed),
            jitter: settings.jitter,
            late: 0.0,
            under_way: vec![Sensors::default(); settings.delay as usize].into(),
            elapsed: 0.0,
        }
    }

    /// Duration of a sample period of `step` seconds, whose end is not where it should be.
    fn taken(&mut self, step: f64) -> f64 {
        let late = if self.jitter > 0.0 {
            self.jitter * self.normal.next().clamp(-JITTER_MAX, JITTER_MAX)
        } else {
            0.0
        };
        let taken = step * (1.0 + late - self.late);
        self.late = late;
        self.elapsed += taken;
        taken
    }
}

impl Rig for Chain {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let seen = self.rig.sense()?;
        let (elapsed, normal) = (self.elapsed, &mut self.normal);
        self.elapsed = 0.0;
        let response = self.response.read(seen.response, elapsed, normal);
        let reference = match (&mut self.base, seen.reference) {
            (Some(channel), Some(value)) => Some(channel.read(value, elapsed, normal)),
            _ => None,
        };
        self.under_way.push_back(Sensors { response, reference });
        let mut oldest = self.under_way.pop_front().unwrap_or_default();
        // Until the first delayed reading arrives, the channel reads zero.
        if oldest.reference.is_none() && reference.is_some() {
            oldest.reference = Some(0.0);
        }
        Ok(oldest)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        if self.output.is_some() {
            return self.hold(drive, step);
        }
        let taken = self.taken(step);
        self.rig.advance(drive, taken)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let taken = self.taken(step);
        let output = self.output.as_ref().and_then(Option::as_ref);
        let displacement = converted(output, drive.displacement);
        self.rig.hold(Drive { displacement, ..drive }, taken)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.rig.ground_truth()
    }
}
