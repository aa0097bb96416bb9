//! The `[chain]` section: the measurement chain between rig and controller, off by default.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use serde::{Deserialize, Serialize};

use super::{Reference, Scene, option};

settings! {
    /// The stages between the rig and the controller; each can be switched off.
    pub struct ChainSettings {
        /// Resolution of the inputs, bits; absent: ideal.
        #[serde(deserialize_with = "option")]
        adc_bits: Option<u32> = None,
        /// Resolution of the output, bits; absent: ideal. Needs `hold`.
        #[serde(deserialize_with = "option")]
        dac_bits: Option<u32> = None,
        /// Range of the response channel, ± this value, over b, `b omega0` or `b omega0²`; readings saturate there.
        response_range: f64 = 2.0,
        /// Range of the base channel and of the output, ± this value, over `b epsilon`; of a velocity or an acceleration times omega0 or omega0².
        base_range: f64 = 4.0,
        /// The base follows held samples instead of an oscillator in the rig.
        hold: bool = false,
        /// RMS of both channels at the working level over the RMS of their noise, dB. The noise is white, and constant in time. Its level belongs to a
        /// response of 0.4 b, in the quantity of its sensor at omega0, and to the requested drive. Absent: no noise.
        #[serde(deserialize_with = "option")]
        snr: Option<f64> = None,
        /// Standard deviation of a sample of the response, in the unit of its sensor (m, m/s or m/s²); replaces what `snr` says of it.
        #[serde(deserialize_with = "option")]
        response_noise: Option<f64> = None,
        /// Standard deviation of a sample of the reference, in the unit of its sensor (m, m/s, m/s²; of a force N); replaces what `snr` says of it.
        #[serde(deserialize_with = "option")]
        reference_noise: Option<f64> = None,
        /// Seed of noise and jitter.
        seed: u64 = 1,
        /// Cut-off of the anti-alias filter (Butterworth, second order), in units of omega0; absent: no filter.
        #[serde(deserialize_with = "option")]
        filter: Option<f64> = None,
        /// Standard deviation of the sampling instants, in samples.
        jitter: f64 = 0.0,
        /// Delay from the sensors to the controller, samples.
        delay: u32 = 0,
        /// Whether a sensor reads the base.
        reference: bool = true,
    }
}

/// Amplitude of the response over b to which `chain.snr` belongs.
const WORKING_LEVEL: f64 = 0.4;

impl Scene {
    /// Units of what the sensors of response and reference read: m, m/s, m/s², or N of a force.
    pub fn reading_units(&self) -> [&'static str; 2] {
        let [response, reference] = self.resonance.measurands().map(|measurand| measurand.unit());
        match self.definition().reference {
            Reference::Base => [response, reference],
            Reference::Force => [response, Reference::Force.unit()],
        }
    }

    /// Standard deviations of a sample of response and reference by the noise of their sensors, in the units in which a rig is read: the force on an
    /// oscillator as the base that makes it at omega0.
    pub fn noise(&self) -> [f64; 2] {
        let (chain, d) = (&self.chain, self.dimensionless());
        let ratio = chain.snr.map_or(0.0, |snr| FRAC_1_SQRT_2 * 10_f64.powf(-snr / 20.0));
        let levels = [self.units().response.of_metres(WORKING_LEVEL * d.b), self.drive()];
        let per_reading = match self.resonance.reference {
            Reference::Force if self.structure.is_none() => {
                let static_force = self.plant.stiffness * Reference::Force.per_base(d.epsilon * d.lambda);
                [1.0, static_force.recip()]
            }
            _ => [1.0; 2],
        };
        let measurands = self.resonance.measurands();
        let stated = [chain.response_noise, chain.reference_noise];
        [0, 1].map(|n| match stated[n] {
            Some(noise) => noise * per_reading[n],
            None => ratio * levels[n] * d.omega0.powi(measurands[n].order()),
        })
    }

    /// Magnitudes of readings of response and reference, as displacements in m of the oscillator, of the last step of their converters; infinite without
    /// converters.
    pub(crate) fn ranges(&self) -> [f64; 2] {
        let (chain, d) = (&self.chain, self.dimensionless());
        let ranges = [chain.response_range * d.b, d.amplitude(chain.base_range)];
        ranges.map(|range| match chain.adc_bits {
            // Two's complement has a step less on one side.
            Some(bits) => range * (1.0 - 3.0 / 2_f64.powi(bits as i32)),
            None => f64::INFINITY,
        })
    }
}

impl ChainSettings {
    /// Whether anything is switched on; ranges and a seed alone switch nothing on.
    pub fn is_on(&self) -> bool {
        let Self { response_range, base_range, seed, .. } = *self;
        let off = Self { response_range, base_range, seed, ..Self::default() };
        *self != off
    }

    /// Delay from the drive to the sensors, in units of 1/omega0, for samples `step` apart: on average, a held sample lags by half a
    /// sample.
    pub(crate) fn total_delay(&self, step: f64) -> f64 {
        let held = if self.hold { 0.5 } else { 0.0 };
        // The phase of the filter at omega0.
        let filter = self.filter.map_or(0.0, |cut_off| {
            let x = 1.0 / cut_off;
            (SQRT_2 * x).atan2(1.0 - x * x)
        });
        (f64::from(self.delay) + held) * step + filter
    }
}
