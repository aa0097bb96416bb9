//! Curves of phase resonance of the plant with an effect, which have no closed form: the plant's own periodic motions near each measured point, and
//! at some amplitudes of each record.

use std::f64::consts::FRAC_PI_2;

use lovines::Parameters;
use nalgebra::Vector3;
use vines_estimate::Backbone;
use vines_model::orbit::{Condition, PlantMotion, periodic_motion, resonant_motion};
use vines_model::{Definition, Dimensionless};

use crate::branch::FASTEST;
use crate::hypothesis::Hypothesis;
use crate::points::MeasuredPoint;
use crate::quantity::{STEP, Unknowns};

/// What a motion is looked for near to.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Goal {
    /// A measured point: the place of the curve nearest to it.
    Point(MeasuredPoint),
    /// An amplitude of a record, m: the motion of this amplitude, at phase resonance.
    Amplitude(f64),
}

impl Goal {
    fn response(&self) -> f64 {
        match self {
            Self::Point(point) => point.response.value,
            Self::Amplitude(amplitude) => *amplitude,
        }
    }

    fn definition(&self, definition: Definition) -> Definition {
        definition.at_phase(match self {
            Self::Point(point) => point.phase,
            Self::Amplitude(_) => -FRAC_PI_2,
        })
    }
}

/// A motion on the curve.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    motion: PlantMotion,
    /// Response, frequency and drive, with what is changed beside the particle.
    values: Vector3<f64>,
    /// Direction of the curve: change of the response over b and of the frequency over epsilon omega0, a unit vector.
    tangent: [f64; 2],
    /// Change of response, frequency and drive along the curve.
    pub along: Vector3<f64>,
    /// Whether the curve has the amplitude that is looked for; otherwise it has ended in a fold.
    is_found: bool,
}

/// Amplitudes of a record.
pub(crate) const AMPLITUDES: usize = 24;
/// Most steps along the curve from goal to goal.
const MOST_STEPS: usize = 30;
/// Longest step along the curve, in units of its tangent.
const LONGEST: f64 = 0.1;
/// Number of steps that are tried, each half of the one before: beside a small particle the frequency may turn within a thousandth of b.
const HALVINGS: i32 = 10;
/// Difference of the response over b at which a motion is at a goal.
const NEAR: f64 = 1e-3;

/// A plant whose curve is followed.
pub(crate) struct Motions<'a> {
    /// What is true of it.
    pub hypothesis: Hypothesis,
    /// Its unknowns.
    pub x: Unknowns,
    /// The plant.
    pub plant: Parameters,
    /// What counts as resonance.
    pub definition: Definition,
    /// What is looked for.
    pub goals: &'a [Goal],
}

impl Motions<'_> {
    /// b, m, and epsilon omega0, rad/s.
    fn units(&self) -> [f64; 2] {
        [
            self.plant.half_width,
            self.plant.mass_ratio() * self.plant.natural_frequency(),
        ]
    }

    fn values(&self, motion: &PlantMotion) -> Vector3<f64> {
        let place = [motion.response.norm(), motion.omega, motion.amplitude];
        self.hypothesis.changed(&self.x, place).into()
    }

    /// Of a line across the curve, the direction that a motion has no part of, in the units of the tangent: that of the curve where lengths are over the
    /// uncertainties of a point. Another plant's motion on the line is then the nearest one to the first order.
    fn normal(&self, n: usize, tangent: [f64; 2]) -> [f64; 2] {
        let Goal::Point(point) = &self.goals[n] else {
            return tangent;
        };
        let ([length, rate], u) = (self.units(), uncertainties(point));
        let normal = [tangent[0] * (length / u[0]).powi(2), tangent[1] * (rate / u[1]).powi(2)];
        normal.map(|component| component / normal[0].hypot(normal[1]))
    }

    /// The motion of goal `n` near `near` on the line across the curve, `ahead` of it.
    fn motion(&self, n: usize, near: &PlantMotion, tangent: [f64; 2], ahead: f64) -> Option<PlantMotion> {
        let [length, rate] = self.units();
        let at = [
            near.response.norm() + ahead * tangent[0] * length,
            near.omega + ahead * tangent[1] * rate,
        ];
        self.on_line(n, near, at, self.normal(n, tangent))
    }

    fn on_line(&self, n: usize, near: &PlantMotion, at: [f64; 2], normal: [f64; 2]) -> Option<PlantMotion> {
        let definition = self.goals[n].definition(self.definition);
        let (numbers, phase) = (Dimensionless::of(&self.plant, 0.0), definition.phase);
        let at = [at[0] / numbers.b, numbers.sigma(at[1])];
        let conditions = [Condition::Phase(phase), Condition::Across { phase, at, normal }];
        let motion = periodic_motion(&self.plant, definition, near, conditions).ok()?;
        // As in closed form: far above its loss of stability no rig keeps the symmetric motion.
        let is_faster = motion.state.dq2.abs() > FASTEST * self.plant.half_width * motion.omega;
        (!is_faster).then_some(motion)
    }

    /// As [`Self::motion`], with the direction of the curve there.
    fn place(&self, n: usize, near: &PlantMotion, tangent: [f64; 2], ahead: f64) -> Option<Place> {
        let motion = self.motion(n, near, tangent, ahead)?;
        let next = self.motion(n, &motion, tangent, STEP)?;
        let [length, rate] = self.units();
        let change = [
            (next.response.norm() - motion.response.norm()) / length,
            (next.omega - motion.omega) / rate,
        ];
        let size = change[0].hypot(change[1]);
        let values = self.values(&motion);
        let along = (self.values(&next) - values) / size;
        let tangent = change.map(|component| component / size);
        Some(Place { motion, values, tangent, along, is_found: true })
    }

    /// The motions with the amplitudes of the goals, or at the fold, from the largest one along the curve.
    pub fn along(&self) -> Option<Vec<Place>> {
        let mut order: Vec<usize> = (0..self.goals.len()).collect();
        order.sort_by(|one, other| self.goals[*other].response().total_cmp(&self.goals[*one].response()));
        let first = *order.first()?;
        let definition = self.goals[first].definition(self.definition);
        let mut near = resonant_motion(&self.plant, definition, self.goals[first].response(), None).ok()?;
        let (mut tangent, mut places) = ([1.0, 0.0], Vec::new());
        for n in order {
            let mut place = self.place(n, &near, tangent, 0.0)?;
            for _ in 0..MOST_STEPS {
                let rest = (self.goals[n].response() - place.motion.response.norm()) / self.units()[0];
                // Beyond the fold the amplitude rises again.
                if rest.abs() < NEAR || place.tangent[0] < 0.0 {
                    break;
                }
                let ahead = (rest / place.tangent[0]).clamp(-LONGEST, LONGEST);
                // Where the curve bends, a long step along its tangent finds no motion.
                let mut steps = (0..HALVINGS).map(|n| ahead * 0.5_f64.powi(n));
                place = steps.find_map(|step| self.place(n, &place.motion, place.tangent, step))?;
            }
            (near, tangent) = (place.motion.clone(), place.tangent);
            places.push((n, self.arrived(n, place)));
        }
        places.sort_by_key(|(n, _)| *n);
        Some(places.into_iter().map(|(_, place)| place).collect())
    }

    /// The place, or, of an amplitude, the motion that has it.
    fn arrived(&self, n: usize, place: Place) -> Place {
        let Goal::Amplitude(amplitude) = self.goals[n] else {
            return place;
        };
        match self.on_line(n, &place.motion, [amplitude, place.motion.omega], [1.0, 0.0]) {
            Some(motion) => Place {
                values: self.values(&motion),
                motion,
                is_found: true,
                ..place
            },
            None => Place { is_found: false, ..place },
        }
    }

    /// The motions near those of another plant: each moves along its curve to the place nearest to its point.
    pub fn near(&self, places: &[Place]) -> Option<Vec<Place>> {
        let moved = places.iter().enumerate().map(|(n, place)| {
            let Goal::Point(point) = &self.goals[n] else {
                return Some(self.arrived(n, place.clone()));
            };
            let here = self.place(n, &place.motion, place.tangent, 0.0)?;
            let u = uncertainties(point);
            let (apart, along) = (here.apart(point), here.along.component_div(&u));
            let ahead = -along.dot(&apart) / along.norm_squared();
            if ahead.abs() < NEAR {
                return Some(here);
            }
            self.place(n, &here.motion, here.tangent, ahead.clamp(-LONGEST, LONGEST))
        });
        moved.collect()
    }

    /// The motions on the lines of those of a neighbouring plant, without a move along the curve.
    pub fn beside(&self, places: &[Place]) -> Option<Vec<Place>> {
        let moved = places.iter().enumerate().map(|(n, place)| match self.goals[n] {
            // What is not found here has no derivative.
            Goal::Amplitude(_) if !place.is_found => Some(place.clone()),
            Goal::Amplitude(_) => Some(self.arrived(n, place.clone())).filter(|place| place.is_found),
            Goal::Point(_) => {
                let motion = self.motion(n, &place.motion, place.tangent, 0.0)?;
                Some(Place { values: self.values(&motion), motion, ..place.clone() })
            }
        });
        moved.collect()
    }
}

/// Standard uncertainties of response, frequency and drive.
pub(crate) fn uncertainties(point: &MeasuredPoint) -> Vector3<f64> {
    [point.response, point.omega, point.drive]
        .map(|one| one.uncertainty)
        .into()
}

impl Place {
    /// The motion less a point, over its standard uncertainties.
    pub fn apart(&self, point: &MeasuredPoint) -> Vector3<f64> {
        let measured = Vector3::from([point.response, point.omega, point.drive].map(|one| one.value));
        (self.values - measured).component_div(&uncertainties(point))
    }
}

/// The curve at the amplitudes of a record that it has, by rising amplitude.
pub(crate) fn backbone(places: &[Place]) -> Backbone {
    let mut rising: Backbone = Vec::new();
    for place in places.iter().filter(|place| place.is_found) {
        if rising.last().is_none_or(|last| place.values[0] > last[0]) {
            rising.push([place.values[0], place.values[2], place.values[1]]);
        }
    }
    rising
}
