//! The measurement chain around any rig: from the motion to the samples that the controller reads, and from the controller's
//! output to the base.
//!
//! An input passes sensor noise, anti-alias filter, converter and delay, in that order. The output is held from sample to sample
//! and quantised. `[chain]` in the scene switches each stage on.

use std::collections::VecDeque;

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use super::{Drive, Rig, RigError, RigStage, Sensors};
use vines_scene::filter::LowPass;
use vines_scene::scene::{Scene, Units};

/// A rig behind its measurement chain.
pub struct Chain {
    rig: Box<dyn Rig>,
    response: InputChannel,
    base: Option<InputChannel>,
    /// Whether the output is held, and its converter unless that is ideal.
    holds: bool,
    output: Option<Converter>,
    /// Noise and jitter; reproducible on every machine for the same seed.
    random: ChaCha8Rng,
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
struct InputChannel {
    /// Standard deviation of the white noise of its sensor: constant, whatever the signal.
    noise: f64,
    filter: Option<LowPass>,
    converter: Option<Converter>,
}

impl InputChannel {
    fn read(&mut self, value: f64, elapsed: f64, random: &mut ChaCha8Rng) -> f64 {
        let noisy = match self.noise {
            0.0 => value,
            noise => value + noise * normal(random),
        };
        let filtered = self.filter.as_mut().map_or(noisy, |filter| filter.pass(noisy, elapsed));
        self.converter.map_or(filtered, |converter| converter.convert(filtered))
    }
}

impl Chain {
    /// The rig behind its chain, or the rig itself where the chain is off.
    pub fn around(rig: Box<dyn Rig>, scene: &Scene) -> Box<dyn Rig> {
        if !scene.chain.is_on() {
            return rig;
        }
        let (settings, d, noise) = (&scene.chain, scene.dimensionless(), scene.noise());
        let channel = |range: f64, noise: f64| InputChannel {
            noise,
            filter: settings.filter.map(|cut_off| LowPass::new(cut_off * d.omega0)),
            converter: settings.adc_bits.map(|bits| Converter::new(bits, range)),
        };
        let Units { command, reference, response } = scene.units();
        let base_range = d.amplitude(settings.base_range);
        // The ranges of velocities and accelerations belong to the natural frequency.
        let per_displacement = scene
            .resonance
            .measurands()
            .map(|measurand| d.omega0.powi(measurand.order()));
        Box::new(Self {
            rig,
            response: channel(
                response.of_metres(settings.response_range * d.b) * per_displacement[0],
                noise[0],
            ),
            base: settings
                .reference
                .then(|| channel(reference.of_metres(base_range) * per_displacement[1], noise[1])),
            holds: settings.hold,
            output: settings
                .dac_bits
                .map(|bits| Converter::new(bits, command.of_metres(base_range))),
            random: ChaCha8Rng::seed_from_u64(settings.seed),
            jitter: settings.jitter,
            late: 0.0,
            under_way: vec![Sensors::default(); settings.delay as usize].into(),
            elapsed: 0.0,
        })
    }
}

impl RigStage for Chain {
    fn inner(&mut self) -> &mut dyn Rig {
        self.rig.as_mut()
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        let sensors = self.rig.sense()?;
        let (elapsed, random) = (std::mem::take(&mut self.elapsed), &mut self.random);
        let response = self.response.read(sensors.response, elapsed, random);
        let base = self.base.as_mut().zip(sensors.reference);
        let reference = base.map(|(channel, value)| channel.read(value, elapsed, random));
        self.under_way.push_back(Sensors { response, reference });
        let mut oldest = self.under_way.pop_front().unwrap_or_default();
        // Until the first delayed reading arrives, the channel reads zero.
        if oldest.reference.is_none() && reference.is_some() {
            oldest.reference = Some(0.0);
        }
        Ok(oldest)
    }

    fn advance(&mut self, mut drive: Drive, step: f64) -> Result<(), RigError> {
        let mut late = 0.0;
        if self.jitter > 0.0 {
            late = self.jitter * normal(&mut self.random);
        }
        // The end of the sample period is not where it should be.
        let taken = step * (1.0 + late - self.late);
        self.late = late;
        self.elapsed += taken;
        drive.is_held |= self.holds;
        if let Some(converter) = self.output.filter(|_| drive.is_held) {
            drive.displacement = converter.convert(drive.displacement);
        }
        self.rig.advance(drive, taken)
    }
}

// A converter between volts and numbers: a step and a range.

/// Rounds to steps within a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Smallest difference, in the unit of the signal.
    step: f64,
    low: f64,
    high: f64,
}

impl Converter {
    /// A converter with this number of bits, from `-range` to `range` minus one step, as in two's complement.
    pub fn new(bits: u32, range: f64) -> Self {
        let step = 2.0 * range / 2_f64.powi(bits as i32);
        Self { step, low: -range, high: range - step }
    }

    pub fn convert(&self, value: f64) -> f64 {
        ((value / self.step).round() * self.step).clamp(self.low, self.high)
    }
}

// Sensor noise.

/// A random number with mean 0 and standard deviation 1.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::SQRT_2;

    use num_complex::Complex64;

    use super::*;

    /// Amplitude and lag of the output for a sine of frequency 1.
    fn response(cut_off: f64) -> (f64, f64) {
        let mut filter = LowPass::new(cut_off);
        let dt = std::f64::consts::TAU / 200.0;
        let (mut sine, mut cosine) = (0.0, 0.0);
        for n in 0..8_000 {
            let t = f64::from(n) * dt;
            let output = filter.pass(t.sin(), dt);
            if n >= 7_800 {
                sine += output * t.sin() / 100.0;
                cosine += output * t.cos() / 100.0;
            }
        }
        (sine.hypot(cosine), -cosine.atan2(sine))
    }

    #[test]
    fn a_sine_passes_as_the_transfer_function_says() {
        for cut_off in [0.5, 1.0, 3.0, 20.0] {
            let (amplitude, lag) = response(cut_off);
            let x: f64 = 1.0 / cut_off;
            assert!(
                (amplitude - LowPass::gain(cut_off, 1.0)).abs() < 1e-6,
                "{cut_off}: {amplitude}"
            );
            assert!((lag - (SQRT_2 * x).atan2(1.0 - x * x)).abs() < 2e-5, "{cut_off}: {lag}");
        }
    }

    #[test]
    fn noise_behind_a_filter_is_as_correlated_and_as_coloured_as_stated() {
        let (cut_off, step, count) = (5.0, std::f64::consts::TAU / 100.0, 200_000);
        let (mut filter, mut random) = (LowPass::new(cut_off), ChaCha8Rng::seed_from_u64(3));
        let values: Vec<f64> = (0..count).map(|_| filter.pass(normal(&mut random), step)).collect();
        let product = |lag: usize| values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>();
        for lag in [1, 5, 10, 20] {
            let correlation = product(lag) / product(0);
            let stated = LowPass::correlation(cut_off, lag as f64 * step);
            assert!((correlation - stated).abs() < 0.02, "{lag}: {correlation}, {stated}");
        }
        for omega in [1.0, 3.0, 5.0, 10.0] {
            // Of many pieces, 5 periods long.
            let power = |piece: &[f64]| {
                let turned = (0..)
                    .zip(piece)
                    .map(|(n, value)| Complex64::cis(omega * f64::from(n) * step) * value);
                turned.sum::<Complex64>().norm_sqr()
            };
            let density = values.chunks(500).map(power).sum::<f64>() / product(0);
            let stated = LowPass::colour(cut_off, omega, step);
            assert!((density / stated - 1.0).abs() < 0.15, "{omega}: {density}, {stated}");
        }
    }

    #[test]
    fn three_bits_have_eight_values() {
        let converter = Converter::new(3, 1.0);
        let mut seen: Vec<f64> = (-300..300).map(|n| converter.convert(f64::from(n) / 100.0)).collect();
        seen.dedup();
        assert_eq!(seen, [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75]);
    }
}
