//! All symmetric motions of a host at one frequency, in closed form, and the search for the phase-resonant ones over frequency.
//!
//! The host is a sum of [`Section`]s. At phase resonance or under a given drive, the particle's
//! speed V is the root of a quadratic. Time starts at an impact on the wall w = +b; complex amplitudes Z stand for `Im(Z exp(i omega t))`.
//!
//! - The particle turns from -V to +V: the impulse on the host is `J = -2 m V`, and `w'- = 2 V (1 + m S)/(1 + r)` with the velocity S that
//!   a unit impulse gives the cavity.
//! - `q2 = -pi V/(2 omega)` at the impact, because half a period later it is at the opposite point.
//! - Section n is a harmonic and `J p_n`, with the periodic response p to impulses of alternating sign: `p_n = (I + flow_n(T))^-1 kick_n`
//!   after one of them, `p_n - kick_n` before.
//! - With the harmonic Y of q1, `w = b` and `w' = w'-` at the impact give `Im Y = b + alpha V` and `Re Y = beta V`.
//! - The drive is `F = Y/H`, with the response H of the cavity to the drive; the response is linear in Y and V. Phase resonance,
//!   `Re(D conj(F)) = 0` for its harmonic D, is quadratic in V and free of the size of the drive. The exact backbone is therefore
//!   parametrised by its frequency.

use std::f64::consts::{FRAC_PI_2, PI};

use lovines::Section;
use nalgebra::{Complex, Matrix2, Vector2};

use crate::numerics::{bisection, golden_section, quadratic};

/// A particle in its cavity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Mass, kg.
    pub mass: f64,
    /// Half-width b of the cavity, m.
    pub half_width: f64,
    /// Restitution coefficient, in (0, 1].
    pub restitution: f64,
}

/// What is read of the motion, and its phase at resonance.
pub(super) struct Reading<'a> {
    /// Weights (a, b) of every section; `None` for the displacement of the cavity itself.
    pub sections: Option<&'a [[f64; 2]]>,
    /// Weight of m q2.
    pub particle: f64,
    /// Weights (a, b) of every section in the reference, and in what its acceleration is subtracted of; `None` for the drive itself.
    pub reference_sections: Option<&'a [Vec<[f64; 2]>; 2]>,
    /// At resonance, the response lags the reference times this by a quarter of a period; only its direction matters.
    pub reference: Complex<f64>,
}

/// All symmetric motions at one frequency, whatever drives them: everything is linear in V.
pub(super) struct SymmetricMotions {
    omega: f64,
    particle: Particle,
    alpha: f64,
    beta: f64,
    /// Displacement and velocity of the cavity before an impact, per J.
    before: Vector2<f64>,
    /// Velocity of the cavity per impulse.
    mobility: f64,
    drive_over_y: Complex<f64>,
    /// The harmonic of the response is `response_over_y Y + kappa V`.
    response_over_y: Complex<f64>,
    pub(super) kappa: Complex<f64>,
    /// The harmonic of the reference is `reference_over_y Y + reference_kappa V`.
    reference_over_y: Complex<f64>,
    reference_kappa: Complex<f64>,
    reference: Complex<f64>,
}

/// A symmetric motion; time starts at an impact on the wall w = +b.
pub(super) struct SymmetricMotion {
    pub omega: f64,
    /// Speed of the particle.
    pub speed: f64,
    /// Impulse on the host, and relative velocity before it.
    pub impulse: f64,
    pub impact_velocity: f64,
    /// Harmonics of the cavity, the drive and the response.
    pub cavity: Complex<f64>,
    pub drive: Complex<f64>,
    pub response: Complex<f64>,
    /// Harmonic of the reference.
    pub reference: Complex<f64>,
    /// Phase of the response relative to the reference, rad.
    pub phase: f64,
    /// Displacement and velocity of the cavity after the impact.
    pub after: [f64; 2],
}

/// (x, v) of a section after one of the unit impulses of alternating sign that the propagator `flow` separates: minus the state after the one
/// before.
#[inline(always)]
pub(super) fn alternating(section: &Section, flow: &Matrix2<f64>) -> Option<Vector2<f64>> {
    let sum = Matrix2::identity() + flow;
    let (determinant, [x, dx]) = (sum.determinant(), section.kick);
    let solution = Vector2::new(sum.m22 * x - sum.m12 * dx, sum.m11 * dx - sum.m21 * x) / determinant;
    (determinant != 0.0).then_some(solution)
}

/// The harmonic `a x + b v` of (x, v).
pub(super) fn harmonic([a, b]: [f64; 2], [x, v]: [Complex<f64>; 2]) -> Complex<f64> {
    x * a + v * b
}

impl SymmetricMotions {
    #[inline(always)]
    pub(super) fn new(sections: &[Section], particle: Particle, reading: &Reading<'_>, omega: f64) -> Option<Self> {
        let (mut before, mut mobility) = (Vector2::zeros(), 0.0);
        let mut drive_over_y = Complex::new(f64::INFINITY, 0.0);
        let (mut response, mut kicked) = (Complex::<f64>::ZERO, Complex::<f64>::ZERO);
        let mut reference = [Complex::<f64>::ZERO; 2];
        for (n, section) in sections.iter().enumerate() {
            let kick = Vector2::from(section.kick);
            let p_before = alternating(section, &section.propagator(PI / omega))? - kick;
            before += section.at(section.cavity, p_before);
            mobility += section.velocity_per_impulse(section.cavity);

            let (driven, stiffness) = (section.driven(omega), section.stiffness(omega));
            let to_cavity = harmonic(section.cavity, driven);
            if to_cavity != Complex::ZERO {
                // The inverse of a sum of compliances; zero also at an undamped resonance.
                let own = stiffness / to_cavity;
                drive_over_y = if drive_over_y.re.is_infinite() {
                    own
                } else {
                    own * drive_over_y / (own + drive_over_y)
                };
            }
            let compliance = stiffness.inv();
            let mut row = section.cavity;
            if let Some(rows) = reading.sections {
                row = rows[n];
                response += harmonic(row, driven) * compliance;
            }
            kicked += harmonic(row, section.kicked(omega)) * compliance;
            if let Some([rows, inertia]) = reading.reference_sections {
                let row = [0, 1].map(|part| rows[n][part] + omega * omega * inertia[n][part]);
                reference[0] += harmonic(row, driven) * compliance;
                reference[1] += harmonic(row, section.kicked(omega)) * compliance;
            }
        }
        let Particle { mass, restitution, .. } = particle;

        // Impulses through the host, and the particle's triangle wave.
        let impulse = Complex::new(0.0, 2.0 * omega / PI);
        let triangle = Complex::new(0.0, -4.0 / (PI * omega)) * reading.particle;
        Some(Self {
            omega,
            particle,
            alpha: 2.0 * mass * before[0] - FRAC_PI_2 / omega,
            beta: (2.0 * (1.0 + mass * mobility) / (1.0 + restitution) - 1.0 + 2.0 * mass * before[1]) / omega,
            before,
            mobility,
            drive_over_y,
            response_over_y: reading.sections.map_or(Complex::ONE, |_| response * drive_over_y),
            kappa: (kicked * impulse * -2.0 + triangle) * mass,
            reference_over_y: reading
                .reference_sections
                .map_or(drive_over_y, |_| reference[0] * drive_over_y),
            reference_kappa: reference[1] * impulse * (-2.0 * mass),
            reference: reading.reference,
        })
    }

    /// Coefficients of V², V and 1 in `Re(D conj(R))` with the harmonic R of the reference, up to a factor: zero at phase resonance.
    pub(super) fn resonance(&self) -> [f64; 3] {
        let Self { alpha, beta, .. } = *self;
        let b = self.particle.half_width;
        // Only the direction of the drive's harmonic matters for the phase.
        let drive = (self.reference_over_y * self.reference).conj();
        let kicked = self.reference_kappa * self.reference;
        let d = (drive * self.response_over_y).re;
        let u = drive * self.kappa + self.response_over_y.conj() * kicked;
        [
            d * (alpha * alpha + beta * beta) + u.re * beta + u.im * alpha + (self.kappa * kicked.conj()).re,
            (2.0 * alpha * d + u.im) * b,
            d * b * b,
        ]
    }

    /// Distance from phase resonance at the particle speed `speed`, over the largest term of its equation.
    pub(super) fn off_resonance(&self, speed: f64) -> f64 {
        let [square, linear, constant] = self.resonance();
        let terms = [square * speed * speed, linear * speed, constant];
        let largest = terms.iter().fold(0.0_f64, |largest, term| largest.max(term.abs()));
        terms.iter().sum::<f64>() / largest
    }

    /// Speeds of the two motions at phase resonance, each a continuous branch where it exists.
    pub(super) fn phase_resonant(&self) -> Option<[f64; 2]> {
        let [square, linear, constant] = self.resonance();
        quadratic(square, linear, constant)
    }

    /// Speeds of the two motions with a reference of the amplitude `reference`: its square is quadratic in V.
    pub(super) fn driven(&self, reference: f64) -> Option<[f64; 2]> {
        let rest = Complex::new(0.0, self.particle.half_width) * self.reference_over_y;
        let rate = Complex::new(self.beta, self.alpha) * self.reference_over_y + self.reference_kappa;
        quadratic(
            rate.norm_sqr(),
            2.0 * (rest.conj() * rate).re,
            rest.norm_sqr() - reference * reference,
        )
    }

    /// The smallest drive under which there is a motion: the discriminant of the quadratic is zero.
    pub(super) fn least_drive(&self) -> f64 {
        self.drive_over_y.norm() * self.beta.abs() / self.alpha.hypot(self.beta) * self.particle.half_width
    }

    /// (alpha, beta): what the host and the particle contribute to the conditions of impact.
    pub(super) fn impact_conditions(&self) -> Vector2<f64> {
        Vector2::new(self.alpha, self.beta)
    }

    /// First harmonic Y at the particle speed `speed`.
    pub(super) fn y(&self, speed: f64) -> Complex<f64> {
        Complex::new(self.beta * speed, self.particle.half_width + self.alpha * speed)
    }

    /// Amplitude of the reference of the motion at the particle speed `speed`.
    fn reference(&self, speed: f64) -> f64 {
        (self.y(speed) * self.reference_over_y + self.reference_kappa * speed).norm()
    }

    /// The motion at the particle speed `speed`. Whether it is physical, and how stable it is, is not examined.
    pub(super) fn at(&self, speed: f64) -> SymmetricMotion {
        let Particle { mass, restitution, .. } = self.particle;
        let y = self.y(speed);
        let response = y * self.response_over_y + self.kappa * speed;
        let drive = y * self.drive_over_y;
        let reference = y * self.reference_over_y + self.reference_kappa * speed;
        let twice = 2.0 * mass * speed;
        let [q1, before] = (Vector2::new(y.im, self.omega * y.re) - self.before * twice).into();
        SymmetricMotion {
            omega: self.omega,
            speed,
            impulse: -twice,
            impact_velocity: 2.0 * speed * (1.0 + mass * self.mobility) / (1.0 + restitution),
            cavity: y,
            drive,
            response,
            reference,
            phase: (response * (reference * self.reference).conj()).arg(),
            after: [q1, before - twice * self.mobility],
        }
    }
}

// Search over frequency

/// An interval of frequencies in which a function has values, with these, and whether it begins and ends inside of the grid.
pub(super) struct Interval<T> {
    pub points: Vec<(f64, T)>,
    pub inside: [bool; 2],
}

/// The intervals of a grid in which `at` has values; their ends are located to neighbouring doubles.
pub(super) fn intervals<T>(grid: impl IntoIterator<Item = f64>, at: impl Fn(f64) -> Option<T>) -> Vec<Interval<T>> {
    let mut found: Vec<Interval<T>> = Vec::new();
    let mut last: Option<(f64, bool)> = None;
    for omega in grid {
        let value = at(omega);
        let exists = value.is_some();
        let end = last
            .filter(|(_, existed)| *existed != exists)
            .and_then(|(before, existed)| {
                let (left, right) = bisection(before, omega, |omega| at(omega).is_some());
                let end = if existed { left } else { right };
                Some((end, at(end)?))
            });
        if exists && last.is_none_or(|(_, existed)| !existed) {
            let begins = end.is_some();
            found.push(Interval { points: end.into_iter().collect(), inside: [begins, false] });
        } else if let Some((end, interval)) = end.zip(found.last_mut()) {
            interval.points.push(end);
            interval.inside[1] = true;
        }
        if let Some((value, interval)) = value.zip(found.last_mut()) {
            interval.points.push((omega, value));
        }
        last = Some((omega, exists));
    }
    found
}

/// The symmetric motions at phase resonance with a reference of the amplitude `reference` at the frequencies of a grid and between them.
pub(super) fn search(
    grid: impl IntoIterator<Item = f64>,
    reference: f64,
    motions: impl Fn(f64) -> Option<SymmetricMotions>,
) -> Vec<SymmetricMotion> {
    // The references of both motions minus the one that is searched for.
    let excess = |omega: f64| {
        let motions = motions(omega)?;
        let both = motions
            .phase_resonant()?
            .map(|speed| motions.reference(speed) - reference);
        (!both.iter().all(|excess| excess.is_nan())).then_some(both)
    };
    let mut found = Vec::new();
    for (interval, n) in intervals(grid, excess)
        .iter()
        .flat_map(|interval| [(interval, 0), (interval, 1)])
    {
        let points: Vec<_> = interval.points.iter().map(|(omega, both)| [*omega, both[n]]).collect();
        for omega in zeros(&points, |omega| excess(omega).map_or(f64::NAN, |both| both[n])) {
            let motion = motions(omega).and_then(|motions| Some(motions.at(motions.phase_resonant()?[n])));
            // Not where the sign changes through a gap, or in the rounding errors of a motion that needs no drive.
            found.extend(motion.filter(|motion| (motion.reference.norm() - reference).abs() < 1e-7 * reference));
        }
    }
    found
}

/// The zeros of a function between neighbouring points, including two where an extremum between points reaches the other sign.
fn zeros(points: &[[f64; 2]], f: impl Fn(f64) -> f64) -> Vec<f64> {
    let root = |a: f64, b: f64| bisection(a, b, |x| f(x) > 0.0).0;
    let changes = points
        .windows(2)
        .filter(|pair| (pair[0][1] > 0.0) != (pair[1][1] > 0.0));
    let mut found: Vec<f64> = changes.map(|pair| root(pair[0][0], pair[1][0])).collect();
    for triple in points.windows(3) {
        let [[a, at_a], [_, at_middle], [b, at_b]] = [triple[0], triple[1], triple[2]];
        let same_sign = (at_a > 0.0) == (at_middle > 0.0) && (at_middle > 0.0) == (at_b > 0.0);
        if same_sign && at_middle.abs() <= at_a.abs().min(at_b.abs()) {
            let turn = golden_section(a, b, |x| {
                if f(x).is_nan() {
                    f64::INFINITY
                } else {
                    at_a.signum() * f(x)
                }
            });
            if at_a.signum() * f(turn) <= 0.0 {
                found.extend([root(a, turn), root(turn, b)]);
            }
        }
    }
    found
}
