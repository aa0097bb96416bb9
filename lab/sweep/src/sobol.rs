//! The Sobol sequence, point by point.

/// Most axes of a design.
pub(crate) const MOST: usize = 10;

/// Coefficients of the primitive polynomials and initial direction numbers from the second axis on: degree, polynomial, numbers. S. Joe and
/// F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", 2008, table new-joe-kuo-6.
const DIRECTIONS: [(u32, u32, &[u32]); MOST - 1] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
];

/// Direction numbers of an axis, as fractions of 2^32.
pub(crate) fn directions(axis: usize) -> [u32; 32] {
    let mut numbers = [0; 32];
    let Some((degree, polynomial, first)) = axis.checked_sub(1).map(|n| DIRECTIONS[n]) else {
        return std::array::from_fn(|bit| 1 << (31 - bit));
    };
    let degree = degree as usize;
    for bit in 0..32 {
        numbers[bit] = if bit < degree {
            first[bit] << (31 - bit)
        } else {
            let start = numbers[bit - degree] ^ (numbers[bit - degree] >> degree);
            (1..degree)
                .filter(|term| polynomial >> (degree - 1 - term) & 1 == 1)
                .fold(start, |number, term| number ^ numbers[bit - term])
        };
    }
    numbers
}

/// The n-th point of an axis, in [0, 1), in Gray-code order. The sequence has 2^32 points.
pub(crate) fn point(directions: &[u32; 32], n: u64) -> f64 {
    let gray = n ^ (n >> 1);
    let bits = (0..32).filter(|bit| gray >> bit & 1 == 1);
    f64::from(bits.fold(0, |sum, bit| sum ^ directions[bit])) / 2_f64.powi(32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_points_are_those_of_scipy() {
        // scipy.stats.qmc.Sobol(10, scramble=False), points 5 and 1000.
        let point = |n| std::array::from_fn::<f64, MOST, _>(|axis| point(&directions(axis), n));
        assert_eq!(point(5), FIFTH);
        assert_eq!(point(1000), THOUSANDTH);
    }

    const FIFTH: [f64; MOST] = [0.875, 0.875, 0.125, 0.375, 0.875, 0.625, 0.875, 0.375, 0.375, 0.125];
    const THOUSANDTH: [f64; MOST] = [
        0.2197265625,
        0.0966796875,
        0.5185546875,
        0.6767578125,
        0.2802734375,
        0.9072265625,
        0.0458984375,
        0.8994140625,
        0.5009765625,
        0.0693359375,
    ];
}
