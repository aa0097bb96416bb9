//! All symmetric motions at one frequency, in closed form, and the search for the phase-resonant ones over frequency.
//!
//! At phase resonance or under a given excitation, the particle's speed is the root of a quadratic. Time starts at an impact on the wall
//! w = +1; complex amplitudes Z stand for `Im(Z exp(i Omega tau))`.
//!
//! - The particle turns from -B to +B, so `w'- = 2 B (1 + epsilon)/(1 + r)` and the oscillator's velocity jumps by -2 epsilon B.
//! - `q2 = -pi B/(2 Omega)` at the impact, because half a period later it is at the opposite point.
//! - `q1 = y - 2 epsilon B p`, with the harmonic y of amplitude Y and p the periodic response to impulses of alternating sign.
//! - `w = 1` and `w' = w'-` at the impact then give `Im Y = 1 + alpha B` and `Re Y = beta B`.
//! - Phase resonance, `Re(V conj(F)) = 0` for the harmonic V of v and the base's harmonic F, is quadratic in B and free of G;
//!   `G = |F|/epsilon` follows. The exact backbone is therefore parametrised by its frequency.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Complex, Matrix2, Vector2};

use super::oscillator::FreeOscillator;
use super::periodic::wrapped;
use super::{AfterImpact, ImpactPattern, Orbit, Periodic};
use crate::numerics::{bisection, golden_section, quadratic, secant};
use crate::theory::{BranchSide, Manifold, SlowFlow};
use crate::{Definition, Dimensionless, Sensor};

/// All symmetric motions at one frequency, whatever drives them: everything is linear in B.
struct SymmetricMotions {
    omega: f64,
    epsilon: f64,
    r: f64,
    alpha: f64,
    beta: f64,
    /// Difference of the first harmonics of the response (v or q1, by the sensor) and of y, over B.
    kappa: Complex<f64>,
    /// Direction of the reference in the complex plane.
    reference: Complex<f64>,
    base_over_y: Complex<f64>,
    p: Vector2<f64>,
}

impl SymmetricMotions {
    fn new(scene: &Dimensionless, omega: f64) -> Option<Self> {
        let Dimensionless { epsilon, r, .. } = *scene;
        let oscillator = FreeOscillator::new(epsilon * scene.lambda / 2.0);

        // Unit impulses at tau = 0, -T, -2T…, alternating: half a period later the state is minus the one before.
        let flight = oscillator.propagator(PI / omega);
        let p = (Matrix2::identity() + flight).try_inverse()? * Vector2::new(0.0, 1.0);
        let p_before = p - Vector2::new(0.0, 1.0);

        // v = y + B kappa in the first harmonic: impulses through the oscillator, and the particle's triangle wave.
        let impulse = Complex::new(0.0, 2.0 * omega / PI);
        let Definition { sensor, reference, .. } = scene.definition;
        let triangle = match sensor {
            Sensor::V => Complex::new(0.0, -4.0 / (PI * omega)),
            Sensor::Q1 => Complex::new(0.0, 0.0),
        };
        Some(Self {
            omega,
            epsilon,
            r,
            alpha: 2.0 * epsilon * p_before[0] - FRAC_PI_2 / omega,
            beta: (2.0 * (1.0 + epsilon) / (1.0 + r) - 1.0 + 2.0 * epsilon * p_before[1]) / omega,
            kappa: (oscillator.compliance(omega) * impulse * -2.0 + triangle) * epsilon,
            reference: Complex::from_polar(1.0, reference.phase(epsilon * scene.lambda, omega)),
            base_over_y: oscillator.stiffness(omega) / oscillator.base_force(omega),
            p,
        })
    }

    /// Coefficients of B², B and 1 in `Re(V conj(F))`, up to a factor: zero at phase resonance.
    fn resonance(&self) -> [f64; 3] {
        let Self { alpha, beta, .. } = *self;
        // Only the direction of the base's harmonic matters for the phase.
        let d = (self.base_over_y * self.reference).conj();
        let u = d * self.kappa;
        [
            d.re * (alpha * alpha + beta * beta) + u.re * beta + u.im * alpha,
            2.0 * alpha * d.re + u.im,
            d.re,
        ]
    }

    /// Speeds of the two motions at phase resonance, each a continuous branch where it exists.
    fn phase_resonant(&self) -> Option<[f64; 2]> {
        let [square, linear, constant] = self.resonance();
        quadratic(square, linear, constant)
    }

    /// The two motions under the excitation `g`: `|y|^2` is quadratic in B.
    fn driven(&self, g: f64) -> Option<[Orbit; 2]> {
        let Self { alpha, beta, .. } = *self;
        let y = self.epsilon * g / self.base_over_y.norm();
        let speeds = quadratic(alpha * alpha + beta * beta, 2.0 * alpha, 1.0 - y * y)?;
        Some(speeds.map(|b| self.at(b)))
    }

    /// The smallest excitation under which there is a motion: the discriminant of the quadratic is zero.
    fn least_excitation(&self) -> f64 {
        self.base_over_y.norm() / self.epsilon * self.beta.abs() / self.alpha.hypot(self.beta)
    }

    /// First harmonic y at the particle speed `b`.
    fn y(&self, b: f64) -> Complex<f64> {
        Complex::new(self.beta * b, 1.0 + self.alpha * b)
    }

    /// G of the motion at the particle speed `b`.
    fn excitation(&self, b: f64) -> f64 {
        (self.y(b) * self.base_over_y).norm() / self.epsilon
    }

    fn response(&self, b: f64) -> Complex<f64> {
        self.y(b) + self.kappa * b
    }

    /// The motion at the particle speed `b`. Whether it is physical, and how stable it is, is not examined: see [`accept`].
    fn at(&self, b: f64) -> Orbit {
        let (y, v) = (self.y(b), self.response(b));
        let base = y * self.base_over_y;
        let p_before = self.p - Vector2::new(0.0, 1.0);
        let [q1, before] = (Vector2::new(y.im, self.omega * y.re) - p_before * (2.0 * self.epsilon * b)).into();
        Orbit {
            g: base.norm() / self.epsilon,
            sigma: (self.omega - 1.0) / self.epsilon,
            omega: self.omega,
            c: v.norm(),
            gamma: (v * (base * self.reference).conj()).arg(),
            b,
            impact_velocity: 2.0 * b * (1.0 + self.epsilon) / (1.0 + self.r),
            start: AfterImpact {
                phase: base.arg(),
                q1,
                dq1: before - 2.0 * self.epsilon * b,
                q2: q1 - 1.0,
                dq2: b,
            },
            multipliers: [f64::NAN; 4],
            stable: false,
        }
    }
}

/// Frequencies searched, over omega0.
const SEARCHED: [f64; 2] = [0.2, 3.0];
/// Growth of e from one frequency to the next: equal steps around omega0, where the detuning is of order one, and equal ratios beyond.
const GROWTH: f64 = 1.0004;

/// All exact symmetric 1:1 orbits at resonance at the scene's G, by rising C; empty where there are none.
///
/// Frequencies between 0.2 and 3 omega0 are searched on a grid of about 0.001 in the detuning where that is of
/// order one, and every root is refined to the last bit.
pub fn phase_resonant(scene: &Dimensionless) -> Vec<Orbit> {
    let grid = grid(scene.epsilon);
    let candidates = [0, 1]
        .map(|branch| CandidateBranch { scene, branch }.frequencies(&grid))
        .concat();
    let mut orbits = resonant(scene, &candidates);
    orbits.sort_unstable_by(|first, second| first.c.total_cmp(&second.c));
    orbits.dedup_by(|first, second| (first.sigma - second.sigma).abs() < 1e-9 && (first.b - second.b).abs() < 1e-9);
    orbits
}

/// The stable one of [`phase_resonant`] with the smallest C.
pub fn stable_resonant(scene: &Dimensionless) -> Option<Orbit> {
    phase_resonant(scene).into_iter().find(|orbit| orbit.stable)
}

/// The exact backbone: all phase-resonant orbits at the frequency `omega` (over omega0), at any G.
///
/// Without damping and with r = 1 these are the conservative nonlinear mode, with G = 0.
pub fn exact_backbone(scene: &Dimensionless, omega: f64) -> Vec<Orbit> {
    let candidates =
        SymmetricMotions::new(scene, omega).and_then(|motions| Some(motions.phase_resonant()?.map(|b| motions.at(b))));
    resonant(scene, candidates.as_slice().as_flattened())
}

/// All symmetric 1:1 orbits at the detuning `sigma` and the scene's G, at any phase; none or up to two.
pub fn symmetric_orbits(scene: &Dimensionless, sigma: f64) -> Vec<Orbit> {
    SymmetricMotions::new(scene, 1.0 + scene.epsilon * sigma)
        .and_then(|motions| motions.driven(scene.g))
        .into_iter()
        .flatten()
        .filter_map(|orbit| accept(scene, orbit))
        .collect()
}

/// The smallest G under which there is a symmetric 1:1 orbit at the detuning `sigma`, if its flights meet no wall.
pub(super) fn least_excitation(scene: &Dimensionless, sigma: f64) -> f64 {
    SymmetricMotions::new(scene, 1.0 + scene.epsilon * sigma)
        .map_or(f64::INFINITY, |motions| motions.least_excitation())
}

/// Frequencies `1 + epsilon (e - 1/e) / 2` for growing e.
fn grid(epsilon: f64) -> Vec<f64> {
    let [low, high] = SEARCHED.map(|omega| {
        let x = (omega - 1.0) / epsilon;
        (x.abs() + (x * x + 1.0).sqrt()).powi(if x < 0.0 { -1 } else { 1 })
    });
    std::iter::successors(Some(low), |e| Some(e * GROWTH))
        .take_while(|e| *e < high)
        .chain([high])
        .map(|e| 1.0 + 0.5 * epsilon * (e - 1.0 / e))
        .collect()
}

/// The orbits of those candidates whose response lags the base; without dissipation no base motion is needed, and its phase is chosen.
fn resonant(scene: &Dimensionless, candidates: &[Orbit]) -> Vec<Orbit> {
    let lagging = candidates.iter().filter_map(|orbit| {
        let mut orbit = *orbit;
        if orbit.g < 1e-12 {
            orbit.start.phase = wrapped(orbit.start.phase + orbit.gamma + FRAC_PI_2);
            orbit.gamma = -FRAC_PI_2;
        }
        (orbit.gamma.sin() < -1e-12).then_some(orbit)
    });
    lagging.filter_map(|orbit| accept(scene, orbit)).collect()
}

/// The orbit with its stability, if it is physical: the particle moves, and hits the other wall half a period later, not earlier.
fn accept(scene: &Dimensionless, orbit: Orbit) -> Option<Orbit> {
    let sizes = [orbit.b, orbit.c, orbit.g];
    if sizes.iter().any(|size| !size.is_finite()) || orbit.b <= 0.0 || orbit.c <= 1e-12 {
        return None;
    }
    let motion = Periodic::closed(scene, &ImpactPattern::symmetric(), &orbit.unknowns())?;
    Some(Orbit { multipliers: motion.moduli(), stable: motion.stable, ..orbit })
}

/// One of the two branches of candidates, as G over frequency.
struct CandidateBranch<'a> {
    scene: &'a Dimensionless,
    branch: usize,
}

impl CandidateBranch<'_> {
    fn at(&self, omega: f64) -> Option<Orbit> {
        let motions = SymmetricMotions::new(self.scene, omega)?;
        Some(motions.at(motions.phase_resonant()?[self.branch]))
    }

    /// G of the branch minus the scene's G.
    fn excess(&self, omega: f64) -> Option<f64> {
        let motions = SymmetricMotions::new(self.scene, omega)?;
        let excess = motions.excitation(motions.phase_resonant()?[self.branch]) - self.scene.g;
        (!excess.is_nan()).then_some(excess)
    }

    fn frequencies(&self, grid: &[f64]) -> Vec<Orbit> {
        let points = self.stretches(grid);
        let mut found = Vec::new();
        for pair in points.windows(2) {
            let ([a, at_a], [b, at_b]) = (pair[0], pair[1]);
            if (at_a > 0.0) != (at_b > 0.0) {
                found.extend(self.root(a, b));
            }
        }
        for triple in points.windows(3) {
            let [[a, at_a], [_, at_middle], [b, at_b]] = [triple[0], triple[1], triple[2]];
            if a.is_nan() || b.is_nan() {
                continue;
            }
            let same_sign = (at_a > 0.0) == (at_middle > 0.0) && (at_middle > 0.0) == (at_b > 0.0);
            if same_sign && at_middle.abs() <= at_a.abs().min(at_b.abs()) {
                found.extend(self.pair_near_extremum(a, b, at_a.signum()));
            }
        }
        found
    }

    /// The points (omega, excess) where the branch exists, with the ends of its intervals added; NaN separates them.
    fn stretches(&self, grid: &[f64]) -> Vec<[f64; 2]> {
        let mut points: Vec<[f64; 2]> = Vec::with_capacity(grid.len());
        let mut last: Option<(f64, bool)> = None;
        for &omega in grid {
            let excess = self.excess(omega);
            if let Some((before, existed)) = last
                && existed != excess.is_some()
            {
                let (left, right) = bisection(before, omega, |omega| self.excess(omega).is_some());
                let gap = [f64::NAN; 2];
                let end = if existed { left } else { right };
                let end = self.excess(end).map_or(gap, |excess| [end, excess]);
                points.extend(if existed { [end, gap] } else { [gap, end] });
            }
            points.extend(excess.map(|excess| [omega, excess]));
            last = Some((omega, excess.is_some()));
        }
        points
    }

    /// The root between two points of opposite sign; None where the sign changes through a gap, or in the rounding errors
    /// of a motion that needs no excitation.
    fn root(&self, a: f64, b: f64) -> Option<Orbit> {
        if a.is_nan() || b.is_nan() {
            return None;
        }
        let (root, _) = bisection(a, b, |omega| self.excess(omega).is_some_and(|excess| excess > 0.0));
        let candidate = self.at(root)?;
        let close = (candidate.g - self.scene.g).abs() < 1e-7 * self.scene.g;
        close.then_some(candidate)
    }

    /// Two roots between grid points: the excess has an extremum there that reaches the other sign.
    fn pair_near_extremum(&self, a: f64, b: f64, sign: f64) -> Vec<Orbit> {
        let distance = |omega| self.excess(omega).map_or(f64::INFINITY, |excess| sign * excess);
        let turn = golden_section(a, b, distance);
        if distance(turn) > 0.0 {
            return Vec::new();
        }
        [self.root(a, turn), self.root(turn, b)].into_iter().flatten().collect()
    }
}

/// Largest last step of the frequency, as a share of epsilon, and of the speed.
const CONVERGED: f64 = 1e-9;
/// Difference of the first two frequencies, as a share of epsilon, and of the first two speeds: far above rounding, far below the curvature.
const SECANT: f64 = 1e-4;

/// `[Omega, C, G]` on the curve of all symmetric 1:1 motions at phase resonance: the frequency over omega0, the amplitude of the response over b,
/// and the amplitude of the base over `b epsilon`.
///
/// `speed`, the particle speed of the first-order motion, over `b omega0`, parametrises the curve: the exact motion has its impacts at nearly the same
/// phase of the response. Neither the speed itself nor the frequency would do, because both have extrema along the curve.
/// Stability and the flights between the impacts are not examined; [`exact_backbone`] does.
pub fn backbone_at_speed(scene: &Dimensionless, speed: f64) -> Option<[f64; 3]> {
    let motion = at_speed(scene, speed)?;
    Some([motion.omega, motion.c, motion.g])
}

/// The motion of [`backbone_at_speed`].
pub(super) fn at_speed(scene: &Dimensionless, speed: f64) -> Option<Orbit> {
    let Dimensionless { epsilon, lambda, r, .. } = *scene;
    let flow = SlowFlow::new(lambda, r);
    let guess = 1.0 + epsilon * flow.free_detuning(speed);
    // Of the first-order response; the exact one turns through half a circle without dissipation, too.
    let direction = Complex::new((flow.manifold.dissipation + epsilon) * speed, 1.0 - FRAC_PI_2 * speed);
    let motion = |omega: f64| {
        let motions = SymmetricMotions::new(scene, omega)?;
        // The response is i + rate B: it has the direction at this B.
        let rate = motions.response(1.0) - Complex::i();
        let b = direction.re / (rate.re * direction.im - rate.im * direction.re);
        Some((motions, b))
    };
    let off = |omega: f64| {
        let (motions, b) = motion(omega)?;
        let [square, linear, constant] = motions.resonance();
        Some((square * b + linear) * b + constant)
    };
    let omega = secant(off, [guess * (1.0 + SECANT * epsilon), guess], CONVERGED * epsilon)?;
    let (motions, b) = motion(omega)?;
    let motion = motions.at(b);
    let values = [omega, motion.c, motion.g];
    values.iter().all(|value| value.is_finite()).then_some(motion)
}

/// The motion at phase resonance beyond the fold whose response has the amplitude `c` over b.
pub(super) fn at_amplitude(scene: &Dimensionless, c: f64) -> Option<Orbit> {
    let start = Manifold::new(scene.r).b(c, BranchSide::Right)?;
    let excess = |speed: f64| Some(at_speed(scene, speed)?.c - c);
    at_speed(scene, secant(excess, [start * (1.0 + SECANT), start], CONVERGED)?)
}
