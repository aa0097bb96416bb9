//! The `[chain]` section: the measurement chain between rig and controller, off by default.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::{ControllerSettings, SceneError, check, option, positive, within};

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
        /// Signal-to-noise ratio of the sensors, dB: the noise is proportional to the RMS of the signal. Absent: no noise.
        #[serde(deserialize_with = "option")]
        snr: Option<f64> = None,
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

impl ChainSettings {
    /// Whether anything is switched on.
    pub fn is_on(&self) -> bool {
        let Self {
            adc_bits,
            dac_bits,
            hold,
            snr,
            filter,
            jitter,
            delay,
            reference,
            ..
        } = *self;
        adc_bits.or(dac_bits).is_some() || hold || snr.or(filter).is_some() || jitter > 0.0 || delay > 0 || !reference
    }

    /// Delay from the drive to the sensors, in units of 1/omega0, for samples `step` apart: on average, a held sample lags by half a
    /// sample.
    pub fn total_delay(&self, step: f64) -> f64 {
        let held = if self.hold { 0.5 } else { 0.0 };
        (f64::from(self.delay) + held) * step + self.filter_delay()
    }

    /// Phase of the filter at omega0, as a delay in units of 1/omega0.
    fn filter_delay(&self) -> f64 {
        self.filter.map_or(0.0, |cut_off| {
            let x = 1.0 / cut_off;
            (std::f64::consts::SQRT_2 * x).atan2(1.0 - x * x)
        })
    }

    pub(super) fn check(&self, controller: &ControllerSettings) -> Result<(), SceneError> {
        for (key, bits) in [("chain.adc_bits", self.adc_bits), ("chain.dac_bits", self.dac_bits)] {
            within(key, bits.unwrap_or(1).into(), "bits", [1.0, 32.0])?;
        }
        check(
            "chain.dac_bits",
            self.dac_bits.unwrap_or(0).into(),
            "bits",
            self.dac_bits.is_none() || self.hold,
            "needs chain.hold = true: only samples of the drive can be quantised",
        )?;
        positive("chain.response_range", self.response_range, "(over b)")?;
        positive("chain.base_range", self.base_range, "(over b epsilon)")?;
        within("chain.snr", self.snr.unwrap_or(0.0), "dB", [-40.0, 300.0])?;
        // Up to half the sampling frequency.
        let nyquist = 0.5 * controller.samples_per_period;
        within(
            "chain.filter",
            self.filter.unwrap_or(nyquist),
            "(omega0)",
            [2.0, nyquist],
        )?;
        within("chain.jitter", self.jitter, "samples", [0.0, 0.1])?;
        // As the controller checks it; here the keys of a scene are at hand.
        let longest = controller.samples_per_period / (TAU * controller.bandwidth);
        check(
            "chain.delay",
            self.delay.into(),
            "samples",
            f64::from(self.delay) <= longest,
            format!(
                "must be at most {longest:.0}: the detector of the bandwidth {} omega0 lags by as much; lower controller.bandwidth",
                controller.bandwidth
            ),
        )
    }
}
