//! What happens inside steps: the energy balance with damping and a moving base, and whether the particle stays between its walls.
//!
//! With `E` the kinetic energies and that of the spring `k (q1 - e)²/2`:
//! `dE/dt = -c (q1' - e')² + e' [k (e - q1) + c (e' - q1')]` between impacts. Both powers are integrated by Gauss-Legendre quadrature
//! along the motion, with panels that no impact falls into, and panels far shorter than the fastest rate.

use crate::common::Scene;
use lovines::{Drive, Plant};

/// Nodes and weights of the Gauss-Legendre formula with 8 points on [-1, 1] (positive half).
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
];
/// Length of a panel, in units of the reciprocal of the fastest rate: the formula's error is below 1e-17 of the integrand there.
const PANEL: f64 = 0.5;

/// What a walk along a motion shows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Walk {
    /// Error of the energy balance over the sum of the energies exchanged and the energy at the start.
    pub imbalance: f64,
    /// Largest `|w|/b - 1` at the nodes.
    pub outside: f64,
    /// Panels integrated.
    pub panels: u32,
    /// Impacts, and changes between free and stuck, that ended a panel.
    pub events: u32,
}

/// Base displacement and velocity, the signal as seen from now.
fn base(plant: &Plant) -> (f64, f64) {
    let base = plant.base();
    let Drive { signal: [u0, u1, ..], amplitude, omega } = base.drive;
    let (sin, cos) = base.phase.radians().sin_cos();
    if amplitude == 0.0 {
        return (u0, u1);
    }
    (u0 + amplitude * sin, u1 + amplitude * omega * cos)
}

/// Power lost in the damper, and power that the base does, W.
fn powers(plant: &Plant) -> (f64, f64) {
    let p = plant.parameters();
    let s = plant.state();
    let (e, de) = base(plant);
    let slip = s.dq1 - de;
    (
        p.damping * slip * slip,
        de * (p.stiffness * (e - s.q1) - p.damping * slip),
    )
}

/// Follows the scene for so many panels at most.
pub fn walk(scene: &Scene, panels: u32) -> Walk {
    let mut plant = Plant::new(scene.parameters, scene.start).expect("a valid scene");
    plant.begin(scene.drive).expect("a valid drive");
    let p = scene.parameters;
    let fastest = p.fastest_rate().max(scene.drive.omega.abs());
    let panel = PANEL / fastest;
    let at_start = plant.energy(base(&plant).0);
    let (mut lost, mut done, mut exchanged) = (0.0, 0.0, 0.0);
    // The energy of a weight on a tilted axis has no natural zero.
    let mut largest = at_start.abs();
    let mut result = Walk::default();
    while result.panels < panels {
        let mut first = None;
        // A clone looks ahead: the event that ends this panel.
        let mut ahead = plant;
        ahead
            .advance_with(plant.base().drive, panel, |event| {
                first.get_or_insert(event.time());
            })
            .expect("a valid step");
        let length = first.unwrap_or(panel);
        let mut gone = 0.0;
        let nodes =
            (NODES.iter().rev().map(|(x, weight)| (-x, weight))).chain(NODES.iter().map(|(x, weight)| (*x, weight)));
        for (x, weight) in nodes {
            let t = 0.5 * length * (1.0 + x);
            go(&mut plant, t - gone);
            gone = t;
            let (damper, work) = powers(&plant);
            let part = 0.5 * length * weight;
            lost += part * damper;
            done += part * work;
            exchanged += part * (damper + work.abs());
            let s = plant.state();
            // The difference of the two displacements carries their rounding.
            let rounding = 4.0 * f64::EPSILON * s.q1.abs().max(s.q2.abs());
            let ([plus, minus], w) = (p.gaps(), s.q1 - s.q2);
            let outside = (w - plus).max(-w - minus) - rounding;
            result.outside = result.outside.max(outside / p.half_width);
        }
        if first.is_some() {
            // To just behind the event; the next panel begins there. The power hardly changes on the way from it.
            let behind = 1e-12 / fastest;
            go(&mut plant, length - gone);
            go(&mut plant, behind);
            let (damper, work) = powers(&plant);
            lost += behind * damper;
            done += behind * work;
            result.events += 1;
        } else {
            go(&mut plant, length - gone);
        }
        largest = largest.max(plant.energy(base(&plant).0).abs());
        result.panels += 1;
    }
    let dissipated = plant.totals().dissipated + plant.totals().friction;
    let error = plant.energy(base(&plant).0) + dissipated + lost - done - at_start;
    let scale = largest + exchanged + dissipated;
    if scale > 0.0 {
        result.imbalance = error.abs() / scale;
    }
    result
}

/// Advances under the drive as it stands.
fn go(plant: &mut Plant, duration: f64) {
    let drive = plant.base().drive;
    plant.advance(drive, duration.max(0.0)).expect("a valid step");
}
