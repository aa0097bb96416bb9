//! The force of a particle that hits both walls of its cavity in turn, one impact in each half period.
//!
//! Impact k ends a flight of speed V to the opposite wall, half a period after the one before:
//!
//! ```text
//! V_k = r U_k + (1 + r) s_k y'_k,   U_(k+1) = V_k - a T,   V_k T - a T²/2 = 2 b + (y_k + y_(k+1)),   T = t_(k+1) - t_k
//! ```
//!
//! where y is the motion of the mass, s the sign of the wall, and a the acceleration by friction on the floor, which acts on the mass as well. In steady
//! motion `y = A sin`, with an impact at the phase theta, the mean speed `B b omega`, and `f = a/(b omega²)`: `C cos theta = -(R B + pi f/2)`,
//! `C sin theta = pi B/2 - 1`, `R = (1 - r)/(1 + r)`, `C = A/b`. The speed of approach is `2 B/(1 + r)`, of which r may be a function.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use num_complex::Complex64;
use vines_estimate::{Element, Path};
use vines_model::Sensor;
use vines_model::theory::B_SYMMETRY_BREAKING;

/// How the restitution depends on the speed of approach.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// Not at all.
    Constant,
    /// `1 - r` grows as its fifth root.
    Viscoelastic,
    /// r falls as its fourth root.
    Plastic,
}

/// A particle in its cavity. Behind a host with harmonics the constants are effective ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Mass over that of the host.
    pub epsilon: f64,
    /// Half-width of the cavity, m.
    pub b: f64,
    /// Restitution, of a law at `speed`.
    pub r: f64,
    /// Acceleration by friction over `b omega0²`.
    pub friction: f64,
    /// The law of restitution.
    pub law: Law,
    /// Speed of approach over `b omega0`.
    pub speed: f64,
    /// Frequency of the steady motions over omega0: a polynomial of the logarithm of the amplitude, m.
    pub frequency: [f64; 4],
    /// What the response is: of v the force is the displacement of the particle, which is its impulses, integrated twice.
    pub sensor: Sensor,
}

/// Of impulses that are integrated twice, minus their lag, in periods: `1/(i omega + d/dt)²` to the first order.
const INTEGRATED: Complex64 = Complex64::new(0.0, 1.0 / PI);

/// A steady motion: forces are displacements of the base, m.
#[derive(Debug, Clone, Copy)]
pub struct Steady {
    /// The force relative to the phase of the response.
    pub force: Complex64,
    /// Its derivative by the logarithm of the amplitude.
    pub slope: Complex64,
    /// Its lag, periods.
    pub lag: Complex64,
    /// Phase of the response at an impact, rad, and speed of the particle after it, over `b omega`.
    impact: [f64; 2],
    /// Whether the motion exists at this amplitude; otherwise it is that near the fold.
    pub exists: bool,
}

/// Amplitude over that of the fold down to which the closed form is evaluated, and from which on the map starts: the lag diverges at the fold.
const NEAR_FOLD: f64 = 1.002;
const MAP_START: f64 = 1.02;
/// Amplitude over that of the fold above which one lag describes the force. Between 3 and 7 % beyond the fold lies a bias of three standard
/// uncertainties; the number is chosen, not derived.
const BEYOND_FOLD: f64 = 1.0 / 0.93;
/// Rounds for a speed and the restitution that belongs to it: each leaves an eighth of the error or less.
const ROUNDS: usize = 12;
/// Fewest impacts of a stretch.
const FEWEST_IMPACTS: usize = 8;

/// An impact: its time, the motion of the mass there, its number, the particle's speed after it, and the sum of both speeds.
#[derive(Debug, Clone, Copy)]
struct Impact {
    time: f64,
    y: f64,
    number: i64,
    speed: f64,
    sum: f64,
}

impl Particle {
    /// An ideal cavity.
    pub fn ideal([epsilon, b, r]: [f64; 3], sensor: Sensor) -> Self {
        Self {
            epsilon,
            b,
            r,
            friction: 0.0,
            law: Law::Constant,
            speed: 1.0,
            frequency: [1.0, 0.0, 0.0, 0.0],
            sensor,
        }
    }

    /// The particle in units of the frequency at an amplitude, m.
    fn at(&self, amplitude: f64) -> Self {
        let ratio = self
            .frequency
            .iter()
            .rev()
            .fold(0.0, |sum, one| sum * amplitude.ln() + one);
        Self {
            friction: self.friction / (ratio * ratio),
            speed: self.speed / ratio,
            ..*self
        }
    }

    /// Restitution at a speed of approach over `b omega`, and its exponent there.
    fn restitution(&self, speed: f64) -> [f64; 2] {
        let ratio = speed / self.speed;
        match self.law {
            Law::Constant => [self.r, 0.0],
            Law::Viscoelastic => {
                let r = 1.0 - (1.0 - self.r) * ratio.powf(0.2);
                [r, 0.2 * (r - 1.0) / r]
            }
            Law::Plastic => [self.r * ratio.powf(-0.25), -0.25],
        }
    }

    /// `(1 - r)/(1 + r)` at the speed of approach that belongs to a mean speed, its derivative by the mean speed, and the derivative of `r v` by the speed
    /// of approach.
    fn loss(&self, mean: f64) -> [f64; 3] {
        let [mut r, mut exponent] = [self.r, 0.0];
        for _ in 0..ROUNDS {
            let before = r;
            [r, exponent] = self.restitution(2.0 * mean / (1.0 + r));
            if r == before {
                break;
            }
        }
        let slope = r * exponent / (mean * (1.0 + exponent * r / (1.0 + r)));
        [
            (1.0 - r) / (1.0 + r),
            -2.0 * slope / (1.0 + r).powi(2),
            r * (1.0 + exponent),
        ]
    }

    /// `C cos theta` and `C sin theta` at a mean speed.
    fn place(&self, mean: f64) -> [f64; 2] {
        [
            -self.loss(mean)[0] * mean - FRAC_PI_2 * self.friction,
            FRAC_PI_2 * mean - 1.0,
        ]
    }

    /// Mean speed and amplitude, over b, at the fold of a particle whose restitution is the one there.
    fn at_fold(&self) -> [f64; 2] {
        let mut speed = 2.0 / PI;
        for _ in 0..ROUNDS {
            let (before, ratio) = (speed, self.loss(speed)[0]);
            speed = (FRAC_PI_2 - ratio * FRAC_PI_2 * self.friction) / (ratio * ratio + FRAC_PI_2 * FRAC_PI_2);
            if speed == before {
                break;
            }
        }
        let [cosine, sine] = self.place(speed);
        [speed, cosine.hypot(sine)]
    }

    /// Amplitude of the fold, m.
    pub fn fold(&self) -> f64 {
        self.b * self.at_fold()[1]
    }

    /// Amplitude at which the motion loses its symmetry, m.
    pub fn symmetry_breaking(&self) -> f64 {
        let [cosine, sine] = self.place(B_SYMMETRY_BREAKING);
        self.b * cosine.hypot(sine)
    }

    /// The steady motion at an amplitude, m, and its lag: minus the response to a slow growth of ln A, to the first order, over the slope.
    pub fn steady_motion(&self, amplitude: f64) -> Steady {
        // Below the fold there are no motions that have a frequency.
        let one = self.at(amplitude.max(NEAR_FOLD * self.fold()));
        let Self { epsilon, b, friction, sensor, .. } = one;
        let [slowest, fold] = one.at_fold();
        let c = (amplitude / b).max(NEAR_FOLD * fold);
        let by_friction = FRAC_PI_2 * friction;
        // Mean speed.
        let mut speed = slowest;
        for _ in 0..ROUNDS {
            let (before, ratio) = (speed, one.loss(speed)[0]);
            let (k, half) = (ratio * ratio + FRAC_PI_2 * FRAC_PI_2, FRAC_PI_2 - ratio * by_friction);
            let root = half * half - k * (1.0 + by_friction * by_friction - c * c);
            speed = (half + root.max(0.0).sqrt()) / k;
            if speed == before {
                break;
            }
        }
        let ([cosine, sine], [ratio, ratio_slope, rebound]) = (one.place(speed), one.loss(speed));
        // By the logarithm of the amplitude.
        let cosine_slope = -(ratio + speed * ratio_slope);
        let speed_slope = c * c / (cosine * cosine_slope + sine * FRAC_PI_2);
        let theta_slope = (cosine * FRAC_PI_2 - sine * cosine_slope) * speed_slope / (c * c);
        let unit = Complex64::new(0.0, 4.0 / PI * b * epsilon) * Complex64::new(cosine, -sine) / c;
        // Two linear equations for the parts of speed and theta that the growth makes.
        let p = -rebound * PI * (speed_slope + friction * theta_slope) - (1.0 + rebound) * sine;
        let h = PI * (sine + cosine * theta_slope - theta_slope * (speed - by_friction));
        let determinant = -2.0 * cosine * (1.0 - rebound) + PI * (1.0 + rebound) * sine;
        let late_speed = (-2.0 * cosine * p + (1.0 + rebound) * sine * h) / determinant;
        let late_theta = ((1.0 - rebound) * h - PI * p) / determinant;
        // Impulses, and the friction between them.
        let force = Complex64::new(speed, friction);
        let rise = speed_slope - Complex64::i() * force * theta_slope;
        let late = Complex64::from(late_speed - FRAC_PI_2 * (speed_slope + friction * theta_slope))
            - force * theta_slope
            - Complex64::i() * force * late_theta;
        let lag = -late / rise / TAU;
        Steady {
            force: unit * force,
            slope: unit * rise,
            lag: if sensor == Sensor::V { lag - INTEGRATED } else { lag },
            impact: [sine.atan2(cosine), speed + by_friction],
            exists: amplitude > b * fold,
        }
    }

    /// An impact of the steady motion after the time `t`, unless the amplitude there is near the fold.
    fn first(&self, path: &Path, t: f64) -> Option<Impact> {
        let [logarithm, _] = path.at(t);
        let amplitude = logarithm.re.exp();
        if amplitude < MAP_START * self.fold() {
            return None;
        }
        let [theta, speed] = self.steady_motion(amplitude).impact;
        let omega = frequency(path, t);
        let phase = path.omega0 * t + logarithm.im;
        let number = ((phase - theta) / PI).ceil();
        let time = t + (number * PI + theta - phase) / omega;
        Some(Impact {
            time,
            y: path.motion(time)[0],
            number: number as i64,
            speed: speed * self.b * omega,
            sum: 0.0,
        })
    }

    /// The next impact, on the opposite wall; `None` if there is none about half a period later.
    fn next(&self, path: &Path, from: &Impact) -> Option<Impact> {
        let sign = if from.number.rem_euclid(2) == 0 { 1.0 } else { -1.0 };
        let drag = self.friction * self.b * path.omega0 * path.omega0;
        let mut time = from.time + PI / path.omega0;
        let mut gap = 0.0;
        for _ in 0..6 {
            let ([y, velocity], flight) = (path.motion(time), time - from.time);
            gap = y - from.y - 2.0 * sign * self.b + sign * (from.speed - 0.5 * drag * flight) * flight;
            let step = gap / (velocity + sign * (from.speed - drag * flight));
            time -= step.clamp(-0.2 / path.omega0, 0.2 / path.omega0);
        }
        let [y, velocity] = path.motion(time);
        let half_periods = (time - from.time) * path.omega0 / PI;
        let meets = gap.abs() <= 1e-6 * self.b && (0.6..1.5).contains(&half_periods);
        let arrives = from.speed - drag * (time - from.time);
        let approach = sign * velocity + arrives;
        let [r, _] = self.restitution(approach.max(0.0) / (self.b * path.omega0));
        let speed = r * approach + sign * velocity;
        (meets && approach > 0.0 && from.speed >= 0.0).then_some(Impact {
            time,
            y,
            number: from.number + 1,
            speed,
            sum: arrives + speed,
        })
    }

    /// The impacts from a time on, as long as they follow each other; and when the last flight began.
    fn stretch(&self, path: &Path, t: f64) -> (Vec<Impact>, f64) {
        let mut impacts: Vec<Impact> = Vec::new();
        let mut last = self.first(path, t);
        let mut began = t;
        while let Some(impact) = last.filter(|one| one.time < path.ends[1]) {
            began = impact.time;
            last = self.next(path, &impact);
            impacts.extend(last);
        }
        (impacts, if last.is_some() { path.ends[1] } else { began })
    }
}

/// Frequency of a path, rad/s.
fn frequency(path: &Path, t: f64) -> f64 {
    path.omega0 + path.at(t)[1].im
}

/// The middle one of three forces, integrated twice.
fn integrated(three: &[(f64, Complex64)], omega0: f64) -> (f64, Complex64) {
    let [(before, first), (time, force), (after, last)] = [three[0], three[1], three[2]];
    (
        time,
        force + INTEGRATED * (last - first) * (TAU / omega0 / (after - before)),
    )
}

impl Element for Particle {
    fn steady(&self, amplitude: f64) -> Complex64 {
        self.steady_motion(amplitude).force
    }

    fn lag(&self, amplitude: f64) -> Complex64 {
        self.steady_motion(amplitude).lag
    }

    fn is_smooth(&self, amplitude: f64) -> bool {
        (BEYOND_FOLD * self.fold()..self.symmetry_breaking()).contains(&amplitude)
    }

    fn along(&self, path: &Path) -> Option<Vec<Vec<(f64, Complex64)>>> {
        let mut stretches = Vec::new();
        let mut t = path.ends[0];
        while t < path.ends[1] {
            let (impacts, end) = self.stretch(path, t);
            t = end + TAU / path.omega0;
            let unit = Complex64::new(0.0, 4.0 * self.epsilon / (path.omega0 * path.omega0));
            let force = |three: &[Impact]| {
                let turn = |one: &Impact| {
                    let phase = path.omega0 * one.time + path.at(one.time)[0].im - PI * one.number as f64;
                    Complex64::cis(-phase)
                };
                let turns = [0, 1, 2].map(|n| turn(&three[n]));
                let span = three[2].time - three[0].time;
                let drag = self.friction * self.b * path.omega0 * path.omega0;
                let slid = Complex64::new(0.0, 0.5 * drag / frequency(path, three[1].time))
                    * (turns[0] + 2.0 * turns[1] + turns[2]);
                (three[1].time, unit * (three[1].sum * turns[1] + slid) / span)
            };
            if impacts.len() >= FEWEST_IMPACTS {
                let forces: Vec<(f64, Complex64)> = impacts.windows(3).map(force).collect();
                stretches.push(match self.sensor {
                    Sensor::V => forces.windows(3).map(|three| integrated(three, path.omega0)).collect(),
                    Sensor::Q1 => forces,
                });
            }
        }
        Some(stretches)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn below_the_fold_the_motion_is_that_near_it_whatever_the_polynomial_of_the_frequency_is_there() {
        let ideal = Particle::ideal([0.01, 0.01, 0.6], Sensor::Q1);
        let frequency = [-3.0, -2.0, -0.5, -0.05];
        let particle = Particle { law: Law::Plastic, friction: 0.02, frequency, ..ideal };
        let [near, rest] = [1.0, 1e-6].map(|share| particle.steady_motion(share * particle.fold()));
        assert!(
            near.lag.is_finite() && rest.lag == near.lag && rest.force == near.force,
            "{rest:?}"
        );
        assert!(!rest.exists);
    }

    #[test]
    fn the_lag_is_that_of_the_map_along_a_response_that_grows_slowly() {
        let ideal = Particle::ideal([0.01, 0.01, 0.6], Sensor::Q1);
        let slid = Particle { friction: 0.02, ..ideal };
        let laws = [Law::Viscoelastic, Law::Plastic].map(|law| Particle { law, speed: 0.9, ..slid });
        for particle in [ideal, slid, laws[0], laws[1]] {
            for growth in [1e-5, -1e-5] {
                let time: Vec<f64> = (0..200).map(|n| TAU * f64::from(n)).collect();
                let response: Vec<Complex64> = time
                    .iter()
                    .map(|t| (0.005 * (growth * (t - 600.0)).exp()).into())
                    .collect();
                let path = Path::new(&time, &response, 1.0);
                let forces = particle.along(&path).unwrap().concat();
                let (time, force) = forces[forces.len() / 2];
                let steady = particle.steady_motion(path.at(time)[0].re.exp());
                let expected = steady.force - TAU * steady.lag * steady.slope * growth;
                let error = (force - expected).norm() / steady.force.norm();
                assert!(error < 1e-7, "{particle:?}: {error:e}, lag {}", steady.lag);
            }
        }
    }
}
