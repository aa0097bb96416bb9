//! The multipliers of half a period of a host with any number of sections.
//!
//! Without the impact, the map of half a period consists of the flows -F of the sections. The impact adds two products of a column and a row, so
//! that the multipliers are the zeros of a sum over the sections (G. H. Golub, "Some modified matrix eigenvalue problems", SIAM Review 15, 1973):
//! with the kick k and the row c of the cavity of every section, and its vector field A,
//!
//! `f(z) = (1 - mu h1)² + h0 (kappa - mu² h2)`, `h_j = sum of c A^j F (F + z)^-1 k`.
//!
//! The zeros of the polynomial f times all `det(F + z)` are found together, each by Newton's method on the polynomial over its distances from all
//! others (O. Aberth, "Iteration methods for finding all zeros of a polynomial simultaneously", Mathematics of Computation 27, 1973). They start
//! beside the zeros of `det(F + z)`, where those of weakly coupled sections are: the work grows as the square of the number of sections, that of a
//! dense matrix as its cube.

use lovines::Section;
use nalgebra::{Complex, Matrix2, RowVector2, Vector2};

use crate::numerics::MOST_STEPS;

/// The polynomial `a + b z` as `[a, b]`.
type Line = [f64; 2];

/// A section, or several with the same flow: `det(F + z) = z² + u z + v`, and its part `(a + b z)/det(F + z)` in h_j.
struct Part {
    u: f64,
    v: f64,
    parts: [Line; 3],
}

/// What the impact adds to the flows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Impact {
    /// Impulse over the relative velocity before it, negative.
    pub mu: f64,
    /// What a change of the instant of the impact adds: mu times the relative acceleration over the relative velocity, both before it.
    pub kappa: f64,
}

/// Size of the last correction of a zero, over the larger of its modulus and 1, and, where rounding lets it fall no further, the largest.
const ZERO_CONVERGED: f64 = 1e-13;
const ZERO_ROUNDING: f64 = 1e-9;
/// Distance of the start from the zeros of `det(F + z)`, over their moduli. Exactly there, double ones would not part, and pairs could not become
/// real.
const START_OFFSET: f64 = 1e-3;

/// The multipliers, in no order; `None` where the zeros do not converge.
pub(super) fn multipliers(flows: &[(Section, Matrix2<f64>)], impact: Impact) -> Option<Vec<Complex<f64>>> {
    let mut sections: Vec<(Section, Part)> = Vec::new();
    // The zeros of sections whose flow another one has.
    let mut alike = Vec::new();
    for (section, flow) in flows {
        let (u, v) = (flow.trace(), flow.determinant());
        let field = field(section);
        let (kick, mut row) = (Vector2::from(section.kick), RowVector2::from(section.cavity));
        let parts = [0, 1, 2].map(|_| {
            let part = [v * (row * kick)[0], (row * flow * kick)[0]];
            row *= field;
            part
        });
        // Such sections act as one. What they do against each other meets no wall.
        let same = |(other, _): &&mut (Section, Part)| other.oscillator == section.oscillator;
        if let Some((_, other)) = sections.iter_mut().find(same) {
            for (sum, part) in other.parts.iter_mut().zip(parts) {
                *sum = [sum[0] + part[0], sum[1] + part[1]];
            }
            alike.extend(roots(u, v));
        } else {
            sections.push((*section, Part { u, v, parts }));
        }
    }
    let parts: Vec<Part> = sections.into_iter().map(|(_, part)| part).collect();
    let beside = |(n, zero): (usize, Complex<f64>)| zero * (1.0 + Complex::from_polar(START_OFFSET, n as f64));
    let mut zeros: Vec<_> = parts
        .iter()
        .flat_map(|part| roots(part.u, part.v))
        .enumerate()
        .map(beside)
        .collect();
    correct(&mut zeros, &parts, impact)?;
    Some(in_pairs(&zeros).chain(alike).collect())
}

/// The zeros of `z² + u z + v`.
fn roots(u: f64, v: f64) -> [Complex<f64>; 2] {
    let middle = -0.5 * u;
    let square = middle * middle - v;
    if square < 0.0 {
        let root = (-square).sqrt();
        return [-root, root].map(|im| Complex::new(middle, im));
    }
    // Without cancellation.
    let far = middle + square.sqrt().copysign(middle);
    let near = if far == 0.0 { 0.0 } else { v / far };
    [near, far].map(Complex::from)
}

/// The zeros, of which one is real if no other one is nearer to its conjugate than it is itself.
fn in_pairs(zeros: &[Complex<f64>]) -> impl Iterator<Item = Complex<f64>> {
    zeros.iter().enumerate().map(|(n, zero)| {
        let from_conjugate = |(other, _): &(usize, &Complex<f64>)| (zeros[*other] - zero.conj()).norm_sqr();
        let nearest = zeros
            .iter()
            .enumerate()
            .min_by(|one, other| from_conjugate(one).total_cmp(&from_conjugate(other)));
        if nearest.is_none_or(|(other, _)| other == n) {
            zero.re.into()
        } else {
            *zero
        }
    })
}

/// The matrix of the vector field of a section.
pub(super) fn field(section: &Section) -> Matrix2<f64> {
    let oscillator = &section.oscillator;
    Matrix2::new(0.0, 1.0, -oscillator.omega0_squared, -2.0 * oscillator.delta)
}

fn correct(zeros: &mut [Complex<f64>], parts: &[Part], impact: Impact) -> Option<()> {
    // The last corrections; of a zero that is found, 0.
    let mut last = vec![f64::INFINITY; zeros.len()];
    for _ in 0..MOST_STEPS {
        for n in 0..zeros.len() {
            if last[n] == 0.0 {
                continue;
            }
            let correction = correction(parts, zeros, impact, n);
            let size = correction.norm() / zeros[n].norm().max(1.0);
            if !size.is_finite() {
                return None;
            }
            zeros[n] -= correction;
            let found = size < ZERO_CONVERGED || size < ZERO_ROUNDING && size > 0.5 * last[n];
            last[n] = if found { 0.0 } else { size };
        }
        if last.iter().all(|size| *size == 0.0) {
            return has_trace(zeros, parts, impact).then_some(());
        }
    }
    None
}

/// Whether the sum of the zeros is the trace of the map: each is found once.
fn has_trace(zeros: &[Complex<f64>], parts: &[Part], Impact { mu, kappa }: Impact) -> bool {
    let own = |Part { u, parts: [own, rate, _], .. }: &Part| 2.0 * mu * rate[1] - kappa * own[1] - u;
    let trace: f64 = parts.iter().map(own).sum();
    let sum: Complex<f64> = zeros.iter().sum();
    let size: f64 = parts.iter().map(|part| own(part).abs()).sum();
    (trace - sum).norm() <= ZERO_ROUNDING * size
}

/// The correction of a zero: the polynomial over its derivative, both over the distances from all others.
fn correction(parts: &[Part], zeros: &[Complex<f64>], Impact { mu, kappa }: Impact, n: usize) -> Complex<f64> {
    let z = zeros[n];
    let free = |part: &Part| (z + part.u) * z + part.v;
    let norms = parts.iter().map(|part| free(part).norm_sqr()).enumerate();
    let nearest = norms
        .min_by(|one, other| one.1.total_cmp(&other.1))
        .map_or(0, |(own, _)| own);
    // h_j without the nearest section, with derivatives, and the logarithmic derivative of all other factors.
    let (mut sums, mut slopes, mut others) = ([Complex::ZERO; 3], [Complex::ZERO; 3], Complex::ZERO);
    for part in parts[..nearest].iter().chain(&parts[nearest + 1..]) {
        let inverse = free(part).inv();
        let rate = (z + z + part.u) * inverse;
        for ((sum, slope), [a, b]) in sums.iter_mut().zip(&mut slopes).zip(part.parts) {
            let value = (z * b + a) * inverse;
            *sum += value;
            *slope += inverse * b - value * rate;
        }
        others += rate;
    }
    for other in zeros[..n].iter().chain(&zeros[n + 1..]) {
        others -= (z - other).inv();
    }
    // f det(F + z) with the own part of the nearest section multiplied out, so that it is finite at the zeros of det(F + z), and its derivative.
    let Part { u, parts: own, .. } = &parts[nearest];
    let [h0, h1, h2] = own.map(|[a, b]| z * b + a);
    let ([s0, s1, s2], [ds0, ds1, ds2]) = (sums, slopes);
    let (velocity, d_velocity) = (-s1 * mu + 1.0, -ds1 * mu);
    let (curve, d_curve) = (-s2 * mu * mu + kappa, -ds2 * mu * mu);
    let without = velocity * velocity + s0 * curve;
    let d_without = velocity * d_velocity * 2.0 + ds0 * curve + s0 * d_curve;
    let det = free(&parts[nearest]);
    let value = det * without - h1 * velocity * (2.0 * mu) + h0 * curve - s0 * h2 * (mu * mu)
        + mu * mu * (own[1][1] * own[1][1] - own[0][1] * own[2][1]);
    let slope = (z + z + *u) * without + det * d_without - (velocity * own[1][1] + h1 * d_velocity) * (2.0 * mu)
        + curve * own[0][1]
        + h0 * d_curve
        - (ds0 * h2 + s0 * own[2][1]) * (mu * mu);
    value / (slope + value * others)
}
