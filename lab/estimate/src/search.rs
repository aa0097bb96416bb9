//! The downhill simplex of Nelder and Mead (Computer Journal 7, 1965).

/// The minimum of a function of three variables near a start: until the simplex is as small as the tolerances of x and of the values, at most about
/// `most` evaluations.
pub fn simplex(
    start: [f64; 3],
    steps: [f64; 3],
    cost: impl Fn(&[f64; 3]) -> f64,
    [near, level]: [f64; 2],
    most: usize,
) -> [f64; 3] {
    let at = |p: [f64; 3]| (cost(&p), p);
    let mut corners = vec![at(start)];
    for i in 0..3 {
        let mut corner = start;
        corner[i] += steps[i];
        corners.push(at(corner));
    }
    let mut count = 4;
    loop {
        corners.sort_by(|one, other| one.0.total_cmp(&other.0));
        let (best, worst) = (corners[0], corners[3]);
        let size = corners
            .iter()
            .flat_map(|one| (0..3).map(move |i| (one.1[i] - best.1[i]).abs()))
            .fold(0.0, f64::max);
        if count >= most || size < near && worst.0 - best.0 < level {
            return best.1;
        }
        let middle: [f64; 3] = std::array::from_fn(|i| (corners[0].1[i] + corners[1].1[i] + corners[2].1[i]) / 3.0);
        let along = |share: f64| at(std::array::from_fn(|i| middle[i] + share * (worst.1[i] - middle[i])));
        let reflected = along(-1.0);
        count += 1;
        let next = if reflected.0 < best.0 {
            count += 1;
            let further = along(-2.0);
            Some(if further.0 < reflected.0 { further } else { reflected })
        } else if reflected.0 < corners[2].0 {
            Some(reflected)
        } else {
            count += 1;
            let inside = along(if reflected.0 < worst.0 { -0.5 } else { 0.5 });
            (inside.0 < worst.0.min(reflected.0)).then_some(inside)
        };
        match next {
            Some(next) => corners[3] = next,
            None => {
                count += 3;
                for corner in &mut corners[1..] {
                    *corner = at(std::array::from_fn(|i| 0.5 * (best.1[i] + corner.1[i])));
                }
            }
        }
    }
}
