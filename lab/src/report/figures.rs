//! The figures of the report, one file each.

pub mod approach;
pub mod backbone;
pub mod backbones;
pub mod history;
pub mod manifold;
pub mod period;
pub mod regimes;
pub mod responses;
pub mod tracked;

use super::figure::{Panel, Place, line};
use super::theme::{DECAY, LOCK};

/// One of this many points along the decay is drawn.
const THINNED: usize = 4;
const DECAY_LABEL: &str = "free decay, identified";

fn decay_points(panel: &mut Panel, points: impl Iterator<Item = Place>, label: &str) {
    panel.circles(points.collect(), 4, line(DECAY, 16), label);
}

fn locked_point(panel: &mut Panel, place: Place) {
    panel.square(place, LOCK, "locked, measured");
}

/// Error bars of 95 %: places with the half width of the interval, upright or level.
fn error_bars(panel: &mut Panel, bars: impl Iterator<Item = (Place, f64)>, upright: bool) {
    let ends = |((x, y), half): (Place, f64)| {
        if upright {
            [(x, y - half), (x, y + half)]
        } else {
            [(x - half, y), (x + half, y)]
        }
    };
    panel.segments(bars.map(ends).collect(), line(DECAY, 12));
}
