//! Bifurcation curves in (sigma, G) against the bifurcations on frequency responses.

use vines_model::{
    Dimensionless,
    orbit::{Bifurcation, Exploration, Limits, bifurcation_curves, response},
};

const LIMITS: Limits = Limits { sigma: [-5.0, 5.0], g: [0.1, 3.0], points: 2000, step: 0.05 };

#[test]
fn every_bifurcation_of_a_response_lies_on_a_curve() {
    let scene = Dimensionless::new(0.0084, 1.43, 0.65, 1.1);
    let curves = bifurcation_curves(&scene, &LIMITS);
    for one in &curves {
        let points = &one.branch.points;
        let range = |of: fn(&vines_model::orbit::Periodic) -> f64| {
            points
                .iter()
                .map(of)
                .fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)))
        };
        println!(
            "{}: {} points, sigma {:.4?}, G {:.4?}, ends {:?}",
            one.name(),
            points.len(),
            range(|one| one.sigma),
            range(|one| one.g),
            one.branch.ended
        );
        // On the curve a multiplier has its value.
        for motion in points.iter().step_by(7) {
            let apart = |re: f64| {
                motion
                    .multipliers
                    .iter()
                    .map(|[a, b]| (a - re).hypot(*b))
                    .fold(f64::MAX, f64::min)
            };
            let off = match one.kind {
                Bifurcation::Fold => apart(1.0),
                Bifurcation::SymmetryBreaking | Bifurcation::PeriodDoubling => apart(-1.0),
                Bifurcation::Torus => motion
                    .moduli()
                    .iter()
                    .map(|one| (one - 1.0).abs())
                    .fold(f64::MAX, f64::min),
            };
            assert!(off < 1e-6, "{}: {off:e} at {}", one.name(), motion.sigma);
        }
    }
    let mut checked = 0;
    // Levels that the search did not use.
    for g in [0.97, 1.003, 1.37, 1.63, 2.21] {
        let scene = Dimensionless { g, ..scene };
        for component in response(&scene, &LIMITS, Exploration { starts: 0, seed: 1, doublings: 1 }).components {
            let pattern = &component.branch.points[0].pattern;
            for special in component
                .branch
                .special
                .iter()
                .filter(|_| pattern.impacts() == 2 && pattern.periods() == 1)
            {
                let at = (special.motion.sigma, special.motion.g);
                let nearest = curves
                    .iter()
                    .filter(|one| one.kind == special.kind)
                    .flat_map(|one| one.branch.points.windows(2))
                    .map(|pair| to_segment(at, (pair[0].sigma, pair[0].g), (pair[1].sigma, pair[1].g)))
                    .fold(f64::MAX, f64::min);
                println!(
                    "G = {g}: {} of {} at sigma = {:.4}: {nearest:.1e}",
                    special.kind.name(),
                    component.name,
                    at.0
                );
                assert!(nearest < 2e-3, "{} at {at:?}: {nearest}", special.kind.name());
                checked += 1;
            }
        }
    }
    assert!(checked > 15, "{checked}");
}

fn to_segment(at: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let part = (((at.0 - from.0) * dx + (at.1 - from.1) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    (at.0 - from.0 - part * dx).hypot(at.1 - from.1 - part * dy)
}
