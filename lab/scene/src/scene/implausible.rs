//! Values of a scene that are possible, but hardly meant.

use std::f64::consts::TAU;

use lovines::cavity::GRAVITY;
use vines_model::Dimensionless;

use super::{Scene, SceneShaker};

/// A value of a scene that is possible, but hardly meant.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the structure explains them")]
pub struct Implausible {
    pub name: &'static str,
    pub value: f64,
    pub unit: &'static str,
}

impl Scene {
    /// What is possible, but hardly meant: a value in another unit, such as kN/m, g or mm.
    pub fn implausible(&self) -> impl Iterator<Item = Implausible> {
        let d = Dimensionless::of(&self.plant, 0.0);
        let hertz = d.omega0 / TAU;
        let nothing = [0.0, 0.0, f64::INFINITY, 0.0, 0.0];
        let [heavy, shaken, lift, sag, stroke] = self.doubtful_shaker().unwrap_or(nothing);
        [
            ("epsilon = m/M", d.epsilon, "", d.epsilon > 0.3),
            ("lambda = c/(m omega0)", d.lambda, "", d.lambda > 30.0),
            ("b", d.b, "m", d.b > 1.0),
            ("the natural frequency", hertz, "Hz", hertz < 0.1),
            (
                "armature over structure: resonance of both, over the structure's, which the loop holds",
                shaken,
                "",
                heavy > 1.0,
            ),
            (
                "largest force of the coil over the weight of the armature",
                lift,
                "",
                lift < 1.0,
            ),
            (
                "sag of the armature under its weight, over shaker.stroke_max",
                sag,
                "",
                sag > 1.0,
            ),
            ("shaker.stroke_max", stroke, "m", stroke > 1.0),
        ]
        .into_iter()
        .filter_map(|(name, value, unit, is)| is.then_some(Implausible { name, value, unit }))
    }

    /// Mass of the armature over the mass that all modes have at its point, and the frequency of the pole with which structure and shaker answer the
    /// command, over the natural frequency. What the amplifier's limit gives as a force, over the weight of the armature, whose sag, over the
    /// stroke, and the stroke, m: other units than SI are wrong by a factor of 1000.
    fn doubtful_shaker(&self) -> Option<[f64; 5]> {
        let (structure, SceneShaker { shaker, limits, .. }) = self.shaken()?;
        let path = self.knowledge().shaker?;
        let squares = |point: usize| {
            structure
                .modes
                .iter()
                .map(|mode| mode.shape[point].powi(2))
                .sum::<f64>()
        };
        // A heavy armature under a table is what a slip table is.
        let share = structure.drive.map_or(0.0, |point| shaker.mass * squares(point));
        let current = limits.voltage.map(|voltage| voltage / shaker.resistance).into_iter();
        let current = current.chain(limits.current).fold(f64::INFINITY, f64::min);
        let (weight, stroke) = (shaker.mass * GRAVITY, limits.stroke);
        Some([
            share,
            1.0 - path.pole.im / structure.mode().omega,
            shaker.force_factor * current / weight,
            stroke.map_or(0.0, |stroke| weight / (shaker.suspension[0] * stroke)),
            stroke.unwrap_or(0.0),
        ])
    }
}
