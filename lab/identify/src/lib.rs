//! Parameters of a vibro-impact cavity from a record.
//!
//! The curve of phase resonance is that of [`vines_estimate`], with the particle's own force, lag and map; which periods it is of follows from the
//! likelihoods of four motions. The ideal cavity is then fitted to the information of the record on that curve, not to points.

#![forbid(unsafe_code)]

mod branch;
mod hypotheses;
mod hypothesis;
mod ideal_rig;
mod motions;
mod particle;
mod points;
mod quantity;
mod record;
mod regime;

pub use hypotheses::{
    ChannelTest, Data, EXCLUDED, FEWEST_POINTS, Fit, FitError, Hypotheses, MeasuredCurve, probability,
};
pub use hypothesis::Hypothesis;
pub use ideal_rig::IdealRig;
pub use particle::{Particle, Steady};
pub use points::MeasuredPoint;
pub use quantity::{Known, Quantity};
pub use record::{Identified, Samples, Unidentified, identify};
pub use regime::{Expected, Likelihoods, MOTIONS, RESOLUTION, TOLERANCES, one_to_one, rough_scene};
pub use vines_estimate::Signals;
