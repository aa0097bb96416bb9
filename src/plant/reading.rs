//! All that can be read of the plant at one instant, worked out once.

use super::{Plant, State};

/// What the plant's sensors would read at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Positions and velocities.
    pub state: State,
    /// `w = q1 - q2`, m: more exactly than the difference.
    pub relative_displacement: f64,
    /// Displacement of the base, m, where it comes at no cost; else a sine is to be worked out for it.
    pub base: Option<f64>,
}

impl Plant {
    /// What can be read now: the same as [`Self::state`], [`Self::relative_displacement`] and
    /// [`Self::base_displacement`] one by one.
    #[inline]
    pub fn reading(&self) -> Reading {
        let now = self.now();
        let drive = &self.base.drive;
        Reading {
            state: State {
                q1: now.x,
                dq1: now.v,
                q2: now.x - now.w,
                dq2: now.particle,
            },
            relative_displacement: now.w,
            base: (self.course.quick).then(|| drive.signal[0] + drive.amplitude * now.turn.1),
        }
    }
}
