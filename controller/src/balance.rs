//! Balance of power between drive and response: a response that grows or falls as no structure can shows that a sensor or the drive has
//! failed, from the first periods of the drive on.
//!
//! Near resonance the amplitude of the response obeys `A' = g (E cos phi - E_R(A))` (`g`: `response_gain`, `phi`: phase error, `E_R`: the
//! drive that would hold the amplitude). Damping alone takes `delta A/g`, so that `E_R` is not below it; impacts take more, but at most
//! about as much as the largest drive has given. Three sums of what contradicts this, which start at 0 with the drive, are compared with
//! what the exchange between a loose particle and the structure, noise, and an inexact `g` explain:
//!
//! - growth that the drive has not given. A reversed sensor grows against the work of the drive, a response without a drive grows
//!   without any work, and one whose factor is three times too large by three times the work.
//! - loss beyond damping and impacts: a sensor whose factor falls.
//! - in the first periods, while the impacts cannot have taken half of the work: what the response is below that of the linear
//!   structure. A dead sensor, a shaker that is off, or a factor that is three times too small.

use crate::config::Config;
use crate::real::consts::{PI, TAU};
use crate::real::{Real, larger};

// The limits assume that the structure holds no more energy beside its resonance than a loose body that the drive keeps moving, as in a cavity.
// Such a body, of the mass ratio epsilon, moves at the speed `B omega b` between walls 2 b apart. An impact changes the amplitude by at most
// 2 epsilon b B, which is 2 B/G of the drive E = G epsilon b. Steady motions have B up to 1.07, the loss of symmetry, and need a G from about 0.7.
// A structure with a heavier or faster body, or with a second mode near the first, needs `residual_max` = none.

/// Largest growth without work, multiples of the largest drive, beyond `LARGEST_ERROR`: 2 B/G, with the largest B and the least G.
const GROWTH: Real = 3.0;
/// Largest loss beyond damping and impacts, and largest distance below the linear response beyond `LARGEST_ERROR`, multiples of the largest drive. On
/// average impacts take at most what the drive gives, but at once: pi/2 E for half a period. Until the next one a detector of a tenth of the
/// frequency shows the share 1 - exp(-0.1 pi) = 0.27 of it: 0.4 E.
const LOSS: Real = 0.4;
/// Largest loss, as a share of the response before it. A decay loses the share `x` of the response that it starts from beyond what is expected if
/// the damping rate is larger than the configured one by the share `x`: this assumes that the damping rate, with what noise adds, is known to 12 %.
const LOSS_SHARE: Real = 0.12;
/// Largest error of growth and linear response, as a share of it: a factor of two. Sensors are calibrated better, and impacts take less.
const LARGEST_ERROR: Real = 0.5;
/// Damping ratio of a structure whose damping is not known: the largest at which the equation above holds to a tenth, because its error is of the
/// order of the damping ratio. More damping allows more loss and a lower response, so that no sound rig is refused.
const DAMPING: Real = 0.1;

/// Periods in which the response of a rig at rest grows, before impacts have taken half of the work. Then it can be predicted.
pub const GROWING: Real = 8.0;

/// The sums since the drive began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Balance {
    /// Response amplitude at the last sample, m.
    response: Real,
    /// Largest drive, m.
    drive: Real,
    /// Growth without work, m, above its lowest value.
    growth: Real,
    /// Loss beyond damping and impacts, m, above its lowest value.
    loss: Real,
    /// Amplitude of the linear structure under the same drive, m.
    linear: Real,
    /// Phase since the drive began, rad.
    driven: Real,
    /// Phase since the first reading, rad, up to half a period, and the largest reading until then, m: a motion that the detectors have
    /// still to see.
    begun: Real,
    initial: Real,
}

/// What a sample shows.
#[derive(Clone, Copy, Debug)]
pub struct Powers {
    /// Reading of the response, m.
    pub reading: Real,
    /// Phase of a sample, rad.
    pub turn: Real,
    /// Drive, m.
    pub drive: Real,
    /// The drive with the lag of the detectors, m.
    pub lagging: Real,
    /// Measured amplitude of the base, m.
    pub base: Real,
    /// Measured amplitude of the response, m.
    pub response: Real,
    /// Cosine of the phase error; 1 if it is not known.
    pub cosine: Real,
}

impl Balance {
    /// Largest change of the response by an impact, m.
    pub fn impact(&self) -> Real {
        GROWTH * self.drive
    }

    /// Takes a sample. Returns whether it contradicts the balance.
    #[inline]
    pub fn contradicts(&mut self, config: &Config, sample: &Powers) -> bool {
        if self.begun < PI {
            self.begun += sample.turn;
            self.initial = larger(self.initial, sample.reading.abs());
        }
        if sample.drive == 0.0 {
            let Self { begun, initial, .. } = *self;
            *self = Self { response: sample.response, begun, initial, ..Self::default() };
            return false;
        }
        self.drive = larger(self.drive, sample.drive);
        self.driven += sample.turn;
        let gain = config.response_gain * config.sample_time;
        let damping = config.damping_rate.unwrap_or(DAMPING * config.omega_start) * config.sample_time;
        let (response, drive) = (sample.response, self.drive);
        let rise = response - self.response;
        self.response = response;
        let work = gain * sample.base * sample.cosine;
        let given =
            gain * if config.base_bandwidth.is_none() {
                sample.lagging
            } else {
                sample.base
            } * sample.cosine;
        self.growth = larger(self.growth + rise - work, 0.0);
        // Impacts take at most about what the largest drive gives.
        let taken = damping * response + gain * drive;
        self.loss = larger(self.loss + work - rise - taken, 0.0);
        // Nothing answers before the delay. A ramp takes less than the periods in which the response grows.
        let answered = self.driven - config.delay / config.sample_time * sample.turn;
        if answered > 0.0 {
            self.linear += given - damping * self.linear;
        }
        self.growth - self.initial > GROWTH * drive + LARGEST_ERROR * response
            || self.loss > LOSS * drive + LOSS_SHARE * (response + self.loss)
            || answered < GROWING * TAU && self.linear - response > LOSS * drive + LARGEST_ERROR * self.linear
    }
}
