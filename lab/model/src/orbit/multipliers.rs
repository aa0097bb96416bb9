//! The multipliers of half a period of a host with any number of sections.
//!
//! Without the impact, the map of half a period consists of the flows -F of the sections. The impact adds two products of a column and a row, so
//! that the multipliers are the zeros of a sum over the sections (G. H. Golub, "Some modified matrix eigenvalue problems", SIAM Review 15, 1973):
//! with the kick k and the row c of the cavity of every section, and its vector field A,
//!
//! `f(z) = (1 - mu h1)² + h0 (kappa - mu² h2)`, `h_j = sum of c A^j F (F + z)^-1 k`.
//!
//! The polynomial f times all `det(F + z)` is a product of real quadratic factors, one for every section. From the factors of an orbit near this
//! one, Newton's method corrects all in turn (A. A. Grau, "The simultaneous Newton improvement of a complete set of approximate factors of a
//! polynomial", SIAM J. Numer. Anal. 8, 1971): the work grows as the square of the number of sections, that of a dense matrix as its cube.

use lovines::Section;
use nalgebra::{Complex, Matrix2, RowVector2, Vector2};

/// The quadratic `z² + u z + v`, and the polynomials modulo it: `a + b z` as `[a, b]`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Quadratic {
    u: f64,
    v: f64,
}

impl Quadratic {
    /// `det(F + z)`.
    fn of_flow(flow: &Matrix2<f64>) -> Self {
        Self { u: flow.trace(), v: flow.determinant() }
    }

    fn product(&self, [a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
        let square = b * d;
        [a * c - self.v * square, a * d + b * c - self.u * square]
    }

    fn inverse(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let conjugate = a - b * self.u;
        let norm = (a * conjugate + b * b * self.v).recip();
        [conjugate * norm, -b * norm]
    }

    /// Another quadratic modulo this one.
    fn reduced(&self, other: &Self) -> [f64; 2] {
        [other.v - self.v, other.u - self.u]
    }

    fn roots(&self) -> [Complex<f64>; 2] {
        let middle = -0.5 * self.u;
        let square = middle * middle - self.v;
        if square < 0.0 {
            let root = (-square).sqrt();
            return [-root, root].map(|im| Complex::new(middle, im));
        }
        // Without cancellation.
        let far = middle + square.sqrt().copysign(middle);
        let near = if far == 0.0 { 0.0 } else { self.v / far };
        [near, far].map(Complex::from)
    }
}

/// A section, or several with the same flow: `det(F + z)`, and its part `(beta_j + alpha_j z)/det(F + z)` in h_j.
struct Part {
    free: Quadratic,
    parts: [[f64; 2]; 3],
}

/// What the impact adds to the flows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Impact {
    /// Impulse over the relative velocity before it, negative.
    pub mu: f64,
    /// What a change of the instant of the impact adds: mu times the relative acceleration over the relative velocity, both before it.
    pub kappa: f64,
}

/// Size of the last correction of the factors, and, where rounding lets it fall no further, the largest; their coefficients are of order one.
const CONVERGED: f64 = 1e-13;
const ROUNDING: f64 = 1e-9;
/// Largest number of rounds: few are needed, unless the start is too far away, or factors have a zero in common.
const ROUNDS: usize = 12;

/// The multipliers, in no order, near `start`, which has as many; `None` where the factors do not converge.
pub(super) fn multipliers(
    flows: &[(Section, Matrix2<f64>)],
    impact: Impact,
    start: &[[f64; 2]],
) -> Option<Vec<Complex<f64>>> {
    let mut sections: Vec<(Section, Part)> = Vec::new();
    // The factors of sections whose flow another one has.
    let mut alike = Vec::new();
    for (section, flow) in flows {
        let free = Quadratic::of_flow(flow);
        let field = field(section);
        let (kick, mut row) = (Vector2::from(section.kick), RowVector2::from(section.cavity));
        let parts = [0, 1, 2].map(|_| {
            let part = [free.v * (row * kick)[0], (row * flow * kick)[0]];
            row *= field;
            part
        });
        // Such sections act as one. What they do against each other meets no wall.
        let same = |(other, _): &&mut (Section, Part)| other.oscillator == section.oscillator;
        if let Some((_, other)) = sections.iter_mut().find(same) {
            for (sum, part) in other.parts.iter_mut().zip(parts) {
                *sum = [sum[0] + part[0], sum[1] + part[1]];
            }
            alike.push(free);
        } else {
            sections.push((*section, Part { free, parts }));
        }
    }
    let parts: Vec<Part> = sections.into_iter().map(|(_, part)| part).collect();
    // Real zeros that meet and become complex must be of one factor.
    let factors = [false, true].into_iter().find_map(|shifted| {
        let mut factors = factors_of(start, shifted);
        for free in &alike {
            let distance = |n: &usize| (factors[*n].u - free.u).hypot(factors[*n].v - free.v);
            let nearest = (0..factors.len()).min_by(|one, other| distance(one).total_cmp(&distance(other)))?;
            factors.swap_remove(nearest);
        }
        let is_whole = factors.len() == parts.len();
        (is_whole && correct(&mut factors, &parts, impact).is_some()).then_some(factors)
    })?;
    Some(factors.iter().chain(&alike).flat_map(Quadratic::roots).collect())
}

/// Factors with these zeros, of which the complex ones are in pairs. Real ones are paired as they follow each other, from the first, or `shifted` from
/// the second, with the first and the last as a pair.
fn factors_of(zeros: &[[f64; 2]], shifted: bool) -> Vec<Quadratic> {
    let pairs = zeros.iter().filter(|[_, im]| *im > 0.0);
    let pairs = pairs.map(|[re, im]| Quadratic { u: -2.0 * re, v: re * re + im * im });
    let mut real: Vec<f64> = zeros.iter().filter(|[_, im]| *im == 0.0).map(|[re, _]| *re).collect();
    real.sort_unstable_by(f64::total_cmp);
    if shifted && !real.is_empty() {
        real.rotate_left(1);
    }
    let real = real
        .chunks_exact(2)
        .map(|pair| Quadratic { u: -pair[0] - pair[1], v: pair[0] * pair[1] });
    pairs.chain(real).collect()
}

/// The matrix of the vector field of a section.
fn field(section: &Section) -> Matrix2<f64> {
    let oscillator = &section.oscillator;
    Matrix2::new(0.0, 1.0, -oscillator.omega0_squared, -2.0 * oscillator.delta)
}

fn correct(factors: &mut [Quadratic], parts: &[Part], impact: Impact) -> Option<()> {
    let mut last = f64::INFINITY;
    for _ in 0..ROUNDS {
        let mut largest = 0.0_f64;
        for n in 0..factors.len() {
            let [v, u] = correction(parts, factors, impact, n);
            if !(u.is_finite() && v.is_finite()) {
                return None;
            }
            factors[n].u += u;
            factors[n].v += v;
            largest = largest.max(u.abs()).max(v.abs());
        }
        if largest < CONVERGED || largest < ROUNDING && largest > 0.5 * last {
            return has_trace(factors, parts, impact).then_some(());
        }
        last = largest;
    }
    None
}

/// Whether the sum of the zeros is the trace of the map: a zero that has left towards infinity is lost.
fn has_trace(factors: &[Quadratic], parts: &[Part], Impact { mu, kappa }: Impact) -> bool {
    let own = |Part { free, parts: [own, rate, _] }: &Part| 2.0 * mu * rate[1] - kappa * own[1] - free.u;
    let trace: f64 = parts.iter().map(own).sum();
    let sum: f64 = factors.iter().map(|factor| -factor.u).sum();
    let size: f64 = parts.iter().map(|part| own(part).abs()).sum();
    (trace - sum).abs() <= ROUNDING * size
}

/// The correction `a + b z` of a factor: the polynomial over all other factors, modulo this one.
fn correction(parts: &[Part], factors: &[Quadratic], Impact { mu, kappa }: Impact, n: usize) -> [f64; 2] {
    let own = factors[n];
    // Sums of the other sections in h_j, and their polynomials over the other factors.
    let (mut sums, mut ratio) = ([[0.0; 2]; 3], [1.0, 0.0]);
    for (part, factor) in parts
        .iter()
        .zip(factors)
        .enumerate()
        .filter(|(other, _)| *other != n)
        .map(|(_, both)| both)
    {
        let free = own.reduced(&part.free);
        let inverse = own.inverse(free);
        for (sum, part) in sums.iter_mut().zip(part.parts) {
            let [a, b] = own.product(part, inverse);
            *sum = [sum[0] + a, sum[1] + b];
        }
        ratio = own.product(ratio, own.product(free, own.inverse(own.reduced(factor))));
    }
    let scaled = |[a, b]: [f64; 2], by: f64| [a * by, b * by];
    let plus = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a + c, b + d];
    let [others, others_rate, others_curve] = sums;
    let Part { free, parts: [here, here_rate, here_curve] } = &parts[n];
    // f det(F + z) with the own part of the section multiplied out, so that it is finite at the zeros of det(F + z).
    let velocity = plus([1.0, 0.0], scaled(others_rate, -mu));
    let curve = plus([kappa, 0.0], scaled(others_curve, -mu * mu));
    let without = plus(own.product(velocity, velocity), own.product(others, curve));
    let terms = [
        own.product(own.reduced(free), without),
        scaled(own.product(*here_rate, velocity), -2.0 * mu),
        own.product(*here, curve),
        scaled(own.product(others, *here_curve), -mu * mu),
        [mu * mu * (here_rate[1] * here_rate[1] - here[1] * here_curve[1]), 0.0],
    ];
    own.product(terms.into_iter().fold([0.0; 2], plus), ratio)
}
