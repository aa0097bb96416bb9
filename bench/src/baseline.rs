//! What a careful user would write in an afternoon: the closed form between impacts, walls looked for on a grid, and the
//! instant of an impact by Brent's method (crate `roots`). Baseline of all speed ratios; and how two programs take turns.
//!
//! It shares no code with the plant but the names of its parameters, carries the phase from step to step, and knows no sticking: at the end of a
//! chatter it stalls, and it does not see a contact that begins and ends between two points of the grid.

use lovines::Parameters;
use roots::{SimpleConvergency, find_root_brent};

/// Points of the grid per radian of the faster of drive and free oscillation: 24 per period.
const POINTS_PER_RADIAN: f64 = 24.0 / core::f64::consts::TAU;
/// So many impacts between two points of the grid are a stall.
const MOST_IMPACTS: u32 = 1000;

/// The end of a chatter: impacts without end in no time.
#[derive(Clone, Copy, Debug)]
pub struct Stalled;

/// The free oscillation about the particular solution: two amplitudes, by the sign of `zeta - 1`.
#[derive(Clone, Copy, Debug)]
enum Free {
    Under { delta: f64, omega: f64, a: f64, b: f64 },
    Over { first: f64, second: f64, a: f64, b: f64 },
}

/// The motion of the primary mass from an instant on: `M q1'' + c q1' + k q1 = k e + c e'` with `e = amplitude sin(omega t + phase)`.
#[derive(Clone, Copy, Debug)]
struct Motion {
    from: f64,
    free: Free,
    /// Particular solution `p sin + q cos` of `omega t + phase`; times `t` at an undamped resonance.
    p: f64,
    q: f64,
    secular: bool,
    omega: f64,
    phase: f64,
}

impl Motion {
    fn particular(&self, t: f64) -> (f64, f64) {
        let (sin, cos) = (self.omega * t + self.phase).sin_cos();
        let x = self.p * sin + self.q * cos;
        let v = self.omega * (self.p * cos - self.q * sin);
        if self.secular { (x * t, v * t + x) } else { (x, v) }
    }

    fn new(rig: &Parameters, amplitude: f64, omega: f64, phase: f64, from: f64, x: f64, v: f64) -> Self {
        let Parameters { primary_mass: m, stiffness: k, damping: c, .. } = *rig;
        let (detuning, damping) = (k - m * omega * omega, c * omega);
        let square = detuning * detuning + damping * damping;
        let secular = square == 0.0 && amplitude != 0.0;
        let (p, q) = if amplitude == 0.0 {
            (0.0, 0.0)
        } else if secular {
            (0.0, -amplitude * k / (2.0 * m * omega))
        } else {
            (
                amplitude * (k * detuning + damping * damping) / square,
                amplitude * (damping * detuning - k * damping) / square,
            )
        };
        let delta = 0.5 * c / m;
        let mut motion = Self {
            from,
            free: Free::Under { delta, omega: 0.0, a: 0.0, b: 0.0 },
            p,
            q,
            secular,
            omega,
            phase,
        };
        let (xp, vp) = motion.particular(from);
        let (y, dy) = (x - xp, v - vp);
        let square = k / m - delta * delta;
        motion.free = if square > 0.0 {
            let omega = square.sqrt();
            Free::Under { delta, omega, a: y, b: (dy + delta * y) / omega }
        } else {
            let root = (-square).sqrt();
            let first = -delta - root;
            let second = k / m / first;
            let a = (dy - second * y) / (first - second);
            Free::Over { first, second, a, b: y - a }
        };
        motion
    }

    /// Position and velocity `h` after it.
    fn at(&self, h: f64) -> (f64, f64) {
        let (x, v) = self.particular(self.from + h);
        let (y, dy) = match self.free {
            Free::Under { delta, omega, a, b } => {
                let decay = (-delta * h).exp();
                let (sin, cos) = (omega * h).sin_cos();
                let y = decay * (a * cos + b * sin);
                (y, decay * omega * (b * cos - a * sin) - delta * y)
            }
            Free::Over { first, second, a, b } => {
                let (fast, slow) = (a * (first * h).exp(), b * (second * h).exp());
                (fast + slow, first * fast + second * slow)
            }
        };
        (x + y, v + dy)
    }
}

/// The method under way.
#[derive(Clone, Copy, Debug)]
pub struct Baseline {
    rig: Parameters,
    tolerance: f64,
    /// Displacement of the primary mass, m.
    pub q1: f64,
    /// Its velocity, m/s.
    pub dq1: f64,
    /// Displacement of the particle, m.
    pub q2: f64,
    /// Its velocity, m/s.
    pub dq2: f64,
    /// Time since the start, s.
    pub elapsed: f64,
    /// Impacts since the start.
    pub impacts: u64,
    /// Time since the step began, s.
    time: f64,
    drive: (f64, f64),
    phase: f64,
}

impl Baseline {
    /// At `start` (q1, q1', q2, q2'); impact instants are found to `tolerance` seconds.
    pub fn new(rig: Parameters, start: [f64; 4], tolerance: f64) -> Self {
        let [q1, dq1, q2, dq2] = start;
        Self {
            rig,
            tolerance,
            q1,
            dq1,
            q2,
            dq2,
            elapsed: 0.0,
            impacts: 0,
            time: 0.0,
            drive: (0.0, 0.0),
            phase: 0.0,
        }
    }

    /// Advances by `duration` seconds under `e = amplitude sin(omega t + phase)`, the phase going on.
    pub fn advance(&mut self, amplitude: f64, omega: f64, duration: f64) -> Result<(), Stalled> {
        self.drive = (amplitude, omega);
        let end = duration;
        let natural = (self.rig.stiffness / self.rig.primary_mass).sqrt();
        let grid = 1.0 / (POINTS_PER_RADIAN * natural.max(omega));
        let b = self.rig.half_width;
        let mut motion = self.motion();
        // Time since the flight's start, on a grid.
        let (mut h, mut stalled) = (0.0, 0);
        while h < end - self.time {
            let after = (h + grid).min(end - self.time);
            let (q2, dq2) = (self.q2, self.dq2);
            let w = |h: f64| motion.at(h).0 - (q2 + dq2 * h);
            let reached = w(after);
            if reached.abs() < b {
                h = after;
                stalled = 0;
                continue;
            }
            let wall = b.copysign(reached);
            // A flight begins on a wall: the root there is not looked for again.
            let low = if h == 0.0 { 1e-9 * grid } else { h };
            let mut convergency = SimpleConvergency { eps: self.tolerance, max_iter: 100 };
            let Ok(hit) = find_root_brent(low, after, |h| w(h) - wall, &mut convergency) else {
                return Err(Stalled);
            };
            let (x, v) = motion.at(hit);
            self.impact(self.time + hit, x, v, wall);
            motion = self.motion();
            h = 0.0;
            stalled += 1;
            if stalled > MOST_IMPACTS {
                return Err(Stalled);
            }
        }
        let gone = end - self.time;
        (self.q1, self.dq1) = motion.at(gone);
        self.q2 += self.dq2 * gone;
        self.time = 0.0;
        self.elapsed += duration;
        self.phase = (self.phase + omega * duration) % core::f64::consts::TAU;
        Ok(())
    }

    fn motion(&self) -> Motion {
        let (amplitude, omega) = self.drive;
        Motion::new(&self.rig, amplitude, omega, self.phase, self.time, self.q1, self.dq1)
    }

    fn impact(&mut self, time: f64, x: f64, v: f64, wall: f64) {
        let Parameters { primary_mass, particle_mass, restitution, .. } = self.rig;
        let momentum = primary_mass * v + particle_mass * self.dq2;
        let total = primary_mass + particle_mass;
        let separation = -restitution * (v - self.dq2);
        self.q1 = x;
        self.q2 = x - wall;
        self.dq1 = (momentum + particle_mass * separation) / total;
        self.dq2 = self.dq1 - separation;
        self.time = time;
        self.impacts += 1;
    }
}

/// Length of a turn, ns. The state of the processor changes from second to second and meets both programs. The median of a turn leaves out the first runs after the other program's turn, and what interrupts others.
const TURN: f64 = 2e6;

/// Nanoseconds per unit of work: the median of the runs of one turn. `run` returns the nanoseconds that it took and its units of work.
///
/// # Errors
/// An error of a run.
pub fn turn<E>(run: &mut impl FnMut() -> Result<(f64, f64), E>) -> Result<f64, E> {
    let (mut gone, mut costs) = (0.0, Vec::new());
    while gone < TURN {
        let (ns, work) = run()?;
        gone += ns;
        costs.push(ns / work);
    }
    let middle = costs.len() / 2;
    Ok(*costs.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Nanoseconds per unit of work of both programs in the `n`-th pair of turns; each begins every other pair.
///
/// # Errors
/// An error of a run.
pub fn pair<E>(
    n: usize,
    first: &mut impl FnMut() -> Result<(f64, f64), E>,
    second: &mut impl FnMut() -> Result<(f64, f64), E>,
) -> Result<[f64; 2], E> {
    if n.is_multiple_of(2) {
        let ns = turn(first)?;
        Ok([ns, turn(second)?])
    } else {
        let ns = turn(second)?;
        Ok([turn(first)?, ns])
    }
}
