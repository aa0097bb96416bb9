//! The bare equation of motion, `M q'' + c (q' - e') + k (q - e) = 0`, integrated in double-double.
//!
//! Base and mass are one linear system with constant coefficients: `s' = omega c`, `c' = -omega s` for the built-in
//! oscillator, one state for each derivative of the signal. Its Taylor series over a short step is summed, and the step
//! doubled again and again by squaring. Nothing here knows a damping ratio, a resonance or a particular solution.

use lovines::Drive;
use twofloat::TwoFloat;

/// `q, q', sin, cos, u, u', u'', u'''`.
const SIZE: usize = 8;
/// Terms of the series over a step of at most 1/8 of the fastest rate's time: the first left out is below 1e-36.
const TERMS: usize = 22;

pub type Vector = [TwoFloat; SIZE];
pub type Matrix = [Vector; SIZE];

/// The nearest double.
pub fn number(x: TwoFloat) -> f64 {
    x.hi() + x.lo()
}

fn zero() -> TwoFloat {
    TwoFloat::from(0.0)
}

/// One oscillator and its base.
pub struct System {
    rates: Matrix,
    fastest: f64,
}

impl System {
    /// The equation for this mass (kg), stiffness (N/m) and damping (N·s/m).
    pub fn new(mass: f64, stiffness: f64, damping: f64, drive: &Drive) -> Self {
        let mut rates = [[zero(); SIZE]; SIZE];
        let (spring, damper) = (TwoFloat::new_div(stiffness, mass), TwoFloat::new_div(damping, mass));
        let (amplitude, omega) = (drive.amplitude, drive.omega);
        rates[0][1] = TwoFloat::from(1.0);
        rates[1] = [
            -spring,
            -damper,
            spring * amplitude,
            damper * TwoFloat::new_mul(amplitude, omega),
            spring,
            damper,
            zero(),
            zero(),
        ];
        rates[2][3] = TwoFloat::from(omega);
        rates[3][2] = TwoFloat::from(-omega);
        for n in 4..7 {
            rates[n][n + 1] = TwoFloat::from(1.0);
        }
        let fastest = [(stiffness / mass).sqrt(), damping / mass, omega.abs()];
        Self { rates, fastest: fastest.into_iter().fold(0.0, f64::max) }
    }

    /// What `t` seconds do to the state.
    pub fn flow(&self, t: f64) -> Matrix {
        self.flow_precise(t.into())
    }

    /// The same for a time of 32 digits.
    pub fn flow_precise(&self, t: TwoFloat) -> Matrix {
        let doublings = (8.0 * self.fastest * t.hi()).log2().ceil().max(0.0) as i32;
        let h = t * 0.5f64.powi(doublings);
        let mut term = [[zero(); SIZE]; SIZE];
        for (n, row) in term.iter_mut().enumerate() {
            row[n] = TwoFloat::from(1.0);
        }
        let mut flow = term;
        for n in 1..=TERMS {
            let scale = h / n as f64;
            term = product(&self.rates, &term).map(|row| row.map(|x| x * scale));
            for (row, more) in flow.iter_mut().zip(&term) {
                for (x, more) in row.iter_mut().zip(more) {
                    *x += *more;
                }
            }
        }
        for _ in 0..doublings {
            flow = product(&flow, &flow);
        }
        flow
    }
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut product = [[zero(); SIZE]; SIZE];
    for (row, out) in a.iter().zip(&mut product) {
        for (x, line) in row.iter().zip(b) {
            if *x == 0.0 {
                continue;
            }
            for (sum, y) in out.iter_mut().zip(line) {
                *sum += *x * *y;
            }
        }
    }
    product
}

/// The state that a flow leads to.
pub fn after(flow: &Matrix, state: &Vector) -> Vector {
    flow.map(|row| (row.iter().zip(state)).fold(zero(), |sum, (a, x)| sum + *a * *x))
}

/// A start at `q`, `q'`, with the built-in oscillator at phase 0.
pub fn start((q, dq): (f64, f64), drive: &Drive) -> Vector {
    let [u0, u1, u2, u3] = drive.signal;
    [q, dq, 0.0, 1.0, u0, u1, 2.0 * u2, 6.0 * u3].map(TwoFloat::from)
}
