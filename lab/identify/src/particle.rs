//! The force of a particle that hits both walls of its cavity in turn, one impact in each half period.
//!
//! Impact k ends a flight of speed V to the opposite wall, half a period after the one before:
//!
//! ```text
//! V_k = r V_(k-1) + (1 + r) s_k y'_k,      V_k (t_(k+1) - t_k) = 2 b + (y_k + y_(k+1)) (with walls of alternating sign s),
//! ```
//!
//! where y is the motion of the mass. In steady motion `y = A sin`, with an impact at the phase theta and `B = V/(b omega)`:
//! `C cos theta = -R B`, `C sin theta = pi B/2 - 1`, `R = (1 - r)/(1 + r)`, `C = A/b`.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use num_complex::Complex64;
use vines_estimate::{Element, Path};
use vines_model::Sensor;
use vines_model::theory::{B_SYMMETRY_BREAKING, Manifold};

/// A particle in its cavity. Behind a host with harmonics the constants are effective ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Mass over that of the host.
    pub epsilon: f64,
    /// Half-width of the cavity, m.
    pub b: f64,
    /// Restitution.
    pub r: f64,
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
    /// Whether the motion exists at this amplitude; otherwise it is that near the fold.
    pub exists: bool,
}

/// Amplitude over that of the fold down to which the closed form is evaluated, and from which on the map starts: the lag diverges at the fold.
const NEAR_FOLD: f64 = 1.002;
const MAP_START: f64 = 1.02;
/// Amplitude over that of the fold above which one lag describes the force. Between 3 and 7 % beyond the fold lies a bias of three standard
/// uncertainties; the number is chosen, not derived.
const BEYOND_FOLD: f64 = 1.0 / 0.93;
/// Amplitude over that of the loss of symmetry below which the motion counts: at the loss itself the symmetric and the asymmetric motions are one, and
/// a rig that is not quite symmetric leaves it before. The number is chosen, not derived.
const BELOW_LOSS: f64 = 0.98;
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
    /// Amplitude of the fold, m.
    pub fn fold(&self) -> f64 {
        let ratio = (1.0 - self.r) / (1.0 + self.r);
        self.b * ratio / ratio.hypot(FRAC_PI_2)
    }

    /// Amplitude at which the motion loses its symmetry, m.
    pub fn symmetry_breaking(&self) -> f64 {
        self.b * Manifold::new(self.r).c(B_SYMMETRY_BREAKING)
    }

    /// The steady motion at an amplitude, m, and its lag: minus the response to a slow growth of ln A, to the first order, over the slope.
    pub fn steady_motion(&self, amplitude: f64) -> Steady {
        let Self { epsilon, b, r, sensor } = *self;
        let ratio = (1.0 - r) / (1.0 + r);
        let k = ratio * ratio + FRAC_PI_2 * FRAC_PI_2;
        let fold = self.fold();
        let c = (amplitude / b).max(NEAR_FOLD * fold / b);
        let q = (FRAC_PI_2 * FRAC_PI_2 - k * (1.0 - c * c)).sqrt();
        let speed = (FRAC_PI_2 + q) / k;
        let (cosine, sine) = (-ratio * speed, FRAC_PI_2 * speed - 1.0);
        // By the logarithm of the amplitude.
        let speed_slope = c * c / q;
        let theta_slope = (cosine * FRAC_PI_2 + sine * ratio) * speed_slope / (c * c);
        let unit = Complex64::new(0.0, 4.0 / PI * b * epsilon) * Complex64::new(cosine, -sine) / c;
        // Two linear equations for the parts of speed and theta that the growth makes.
        let p = -r * PI * speed_slope - (1.0 + r) * sine;
        let h = PI * (sine + cosine * theta_slope - theta_slope * speed);
        let determinant = -2.0 * cosine * (1.0 - r) + PI * (1.0 + r) * sine;
        let late_speed = (-2.0 * cosine * p + (1.0 + r) * sine * h) / determinant;
        let late_theta = ((1.0 - r) * h - PI * p) / determinant;
        let late = Complex64::new(
            2.0 * late_speed - PI * speed_slope - 2.0 * speed * theta_slope,
            -2.0 * speed * late_theta,
        );
        let rise = Complex64::new(2.0 * speed_slope, -2.0 * speed * theta_slope);
        let lag = -late / rise / TAU;
        Steady {
            force: unit * speed,
            slope: unit * rise / 2.0,
            lag: if sensor == Sensor::V { lag - INTEGRATED } else { lag },
            exists: amplitude > fold,
        }
    }

    /// An impact of the steady motion after the time `t`, unless the amplitude there is near the fold.
    fn first(&self, path: &Path, t: f64) -> Option<Impact> {
        let [logarithm, rate] = path.at(t);
        let amplitude = logarithm.re.exp();
        if amplitude < MAP_START * self.fold() {
            return None;
        }
        let force = self.steady_motion(amplitude).force;
        let omega = path.omega0 + rate.im;
        let theta = -(force / Complex64::i()).arg();
        let phase = path.omega0 * t + logarithm.im;
        let number = ((phase - theta) / PI).ceil();
        let time = t + (number * PI + theta - phase) / omega;
        let speed = force.norm() / self.epsilon * PI / 4.0 * omega;
        Some(Impact {
            time,
            y: path.motion(time)[0],
            number: number as i64,
            speed,
            sum: 0.0,
        })
    }

    /// The next impact, on the opposite wall; `None` if there is none about half a period later.
    fn next(&self, path: &Path, from: &Impact) -> Option<Impact> {
        let sign = if from.number.rem_euclid(2) == 0 { 1.0 } else { -1.0 };
        let mut time = from.time + PI / path.omega0;
        let mut gap = 0.0;
        for _ in 0..6 {
            let [y, velocity] = path.motion(time);
            gap = y - from.y - 2.0 * sign * self.b + sign * from.speed * (time - from.time);
            let step = gap / (velocity + sign * from.speed);
            time -= step.clamp(-0.2 / path.omega0, 0.2 / path.omega0);
        }
        let [y, velocity] = path.motion(time);
        let half_periods = (time - from.time) * path.omega0 / PI;
        let meets = gap.abs() <= 1e-6 * self.b && (0.6..1.5).contains(&half_periods);
        let approach = sign * velocity + from.speed;
        let speed = self.r * from.speed + (1.0 + self.r) * sign * velocity;
        (meets && approach > 0.0 && from.speed >= 0.0).then_some(Impact {
            time,
            y,
            number: from.number + 1,
            speed,
            sum: from.speed + speed,
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
        (BEYOND_FOLD * self.fold()..BELOW_LOSS * self.symmetry_breaking()).contains(&amplitude)
    }

    fn along(&self, path: &Path) -> Option<Vec<Vec<(f64, Complex64)>>> {
        let mut stretches = Vec::new();
        let mut t = path.ends[0];
        while t < path.ends[1] {
            let (impacts, end) = self.stretch(path, t);
            t = end + TAU / path.omega0;
            let unit = Complex64::new(0.0, 4.0 * self.epsilon / (path.omega0 * path.omega0));
            let force = |three: &[Impact]| {
                let one = three[1];
                let phase = path.omega0 * one.time + path.at(one.time)[0].im - PI * one.number as f64;
                (
                    one.time,
                    unit * one.sum * Complex64::cis(-phase) / (three[2].time - three[0].time),
                )
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
