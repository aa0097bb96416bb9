//! Curves in pieces by stability.

/// A place in a panel, in the units of its axes.
pub type Place = (f64, f64);

/// A place, and whether the motion there is stable.
pub type Marked = (Place, bool);

/// Consecutive points of one kind, each run with the point after it so that the curve has no holes.
pub fn runs(points: &[Marked], wanted: bool) -> Vec<Vec<Place>> {
    let mut start = 0;
    points
        .chunk_by(|one, other| one.1 == other.1)
        .filter_map(|run| {
            let from = start;
            start += run.len();
            let to = (start + 1).min(points.len());
            (run[0].1 == wanted).then(|| points[from..to].iter().map(|one| one.0).collect())
        })
        .collect()
}

/// Points inside the ranges; where a curve leaves them it is cut into pieces.
pub fn clipped(points: &[Marked], x: (f64, f64), y: (f64, f64)) -> Vec<Vec<Marked>> {
    let inside = |((a, b), _): &Marked| (x.0..=x.1).contains(a) && (y.0..=y.1).contains(b);
    points
        .chunk_by(|one, other| inside(one) == inside(other))
        .filter(|run| inside(&run[0]))
        .map(<[Marked]>::to_vec)
        .collect()
}

/// Smallest distance of drawn points, as a fraction of the ranges: dashes stay dashes.
const APART: f64 = 0.004;

/// Points at least [`APART`] from each other, with the last and every change of stability.
pub fn thinned(points: &[Marked], x: (f64, f64), y: (f64, f64)) -> Vec<Marked> {
    let mut kept: Vec<Marked> = Vec::new();
    for (n, point) in points.iter().enumerate() {
        let far = kept.last().is_none_or(|last| {
            let dx = (point.0.0 - last.0.0) / (x.1 - x.0);
            let dy = (point.0.1 - last.0.1) / (y.1 - y.0);
            dx.hypot(dy) >= APART || point.1 != last.1
        });
        if far || n + 1 == points.len() {
            kept.push(*point);
        }
    }
    kept
}
