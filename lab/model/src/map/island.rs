//! The outline of the theory's stable island, by marching squares on a fine grid.

use std::convert::Infallible;

use super::grid::Plan;
use crate::numerics::try_bisection;

/// Fine cells across the map, in each direction.
const FINE: usize = 100;

/// Fraction of a fine cell to which its border is found.
const FINEST: f64 = 1.0 / 4096.0;

/// A point of the plane.
type Place = (f64, f64);

/// Segments of the border of the region where first-order theory has a stable symmetric 1:1 motion.
#[must_use]
pub fn outline(plan: &Plan) -> Vec<[Place; 2]> {
    let x = |n: usize| plan.x.from + (plan.x.to - plan.x.from) * n as f64 / FINE as f64;
    let y = |n: usize| plan.y.from + (plan.y.to - plan.y.from) * n as f64 / FINE as f64;
    let inside = |(x, y): Place| plan.theory_stable(x, y);
    let corners: Vec<Vec<bool>> = (0..=FINE)
        .map(|row| (0..=FINE).map(|column| inside((x(column), y(row)))).collect())
        .collect();
    let mut segments = Vec::new();
    for row in 0..FINE {
        for column in 0..FINE {
            // The corners in turn, each with whether it is inside.
            let around = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(dx, dy)| {
                let place = (x(column + dx), y(row + dy));
                (place, corners[row + dy][column + dx])
            });
            let crossings: Vec<Place> = (0..4)
                .filter_map(|n| {
                    let ((from, one), (to, other)) = (around[n], around[(n + 1) % 4]);
                    (one != other).then(|| border(from, to, one, inside))
                })
                .collect();
            segments.extend(crossings.chunks_exact(2).map(|pair| [pair[0], pair[1]]));
        }
    }
    segments
}

/// Where the border is crossed between two places, of which the first is inside or not.
fn border(from: Place, to: Place, at_from: bool, inside: impl Fn(Place) -> bool) -> Place {
    let at = |part: f64| (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1));
    let like_from = |part: f64| Ok::<_, Infallible>(inside(at(part)) == at_from);
    let Ok((_, end)) = try_bisection(0.0, 1.0, FINEST, like_from);
    at(end)
}
