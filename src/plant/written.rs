//! The plant as it is written out: what follows from something else is left out, and worked out again.

use super::course::Course;
use super::{Contact, Driven, Plant, Tally};
use crate::base_motion::BaseMotion;
use crate::crossing::Origin;
use crate::forcing::Forcing;
use crate::parameters::Parameters;
use crate::wall::ImpactLaw;
use serde::{Deserialize, Serialize};

/// All that a plant cannot do without.
#[derive(Serialize, Deserialize)]
pub(super) struct Written {
    parameters: Parameters,
    contact: Contact,
    here: Origin<f64>,
    base: BaseMotion,
    under_way: bool,
    time: f64,
    tally: Tally,
    course: Course,
    /// Frequencies to which the answers of the primary mass alone and of the joint one are known, rad/s.
    answered: (f64, f64),
}

impl From<Plant> for Written {
    fn from(plant: Plant) -> Self {
        Self {
            parameters: plant.parameters,
            contact: plant.contact,
            here: plant.here,
            base: plant.base,
            under_way: plant.under_way,
            time: plant.time,
            tally: plant.tally,
            course: plant.course,
            answered: (plant.alone.forcing.omega, plant.joint.forcing.omega),
        }
    }
}

impl From<Written> for Plant {
    fn from(written: Written) -> Self {
        let p = written.parameters;
        let driven = |mass: f64, omega: f64| {
            let mut driven = Driven::new(mass, &p);
            driven.forcing = Forcing::new(&driven.oscillator, omega);
            driven
        };
        let alone = driven(p.primary_mass, written.answered.0);
        let mut course = written.course;
        course.work_out_again(&alone.oscillator, p.half_width, &written.base.drive);
        Self {
            mass_ratio: p.mass_ratio(),
            law: ImpactLaw::new(&p),
            joint: driven(p.primary_mass + p.particle_mass, written.answered.1),
            alone,
            course,
            parameters: p,
            contact: written.contact,
            here: written.here,
            base: written.base,
            under_way: written.under_way,
            time: written.time,
            tally: written.tally,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Drive, Parameters, Plant, State};

    /// As it comes back from being written out.
    fn again(plant: &Plant) -> Plant {
        let written = super::Written::from(*plant);
        let mut bare = written;
        bare.course = bare.course.bare();
        Plant::from(bare)
    }

    #[test]
    fn a_plant_written_out_at_any_step_goes_on_with_the_same_bits() {
        let start = State {
            q1: -0.42,
            dq1: 0.01,
            q2: -0.99,
            dq2: -0.86,
        };
        for (step, wobble, slope) in [
            (0.063, 0.0, 0.0),
            (0.063, 1e-4, 0.0),
            (6.3, 0.0, 0.0),
            (1.7, 1e-4, 0.0),
            (0.3, 0.0, 1e-3),
        ] {
            let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
            let mut plant = Plant::new(parameters, start).unwrap();
            let mut other = plant;
            for n in 0..3000 {
                let omega = 0.990_417 + wobble * f64::from(n % 7);
                let drive = Drive {
                    signal: [0.0, slope, 0.0, 0.0],
                    ..Drive::harmonic(0.0084 * 1.1, omega)
                };
                other = again(&other);
                assert_eq!(plant.advance(drive, step), other.advance(drive, step));
                assert_eq!(plant.state(), other.state(), "step {n} of {step} s");
            }
            assert!(plant.tally().impacts > 10);
            assert_eq!(plant.tally(), other.tally());
        }
    }
}
