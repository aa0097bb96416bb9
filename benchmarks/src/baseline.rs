//! What a careful user would write in an afternoon: the closed form between impacts, walls looked for on a grid, and the
//! instant of an impact by Brent's method (crate `roots`). Baseline of all speed ratios; and how two programs take turns.
//!
//! It shares no code with the plant but the names of its parameters, carries the phase from step to step, and knows no sticking: at the end of a
//! chatter it stalls, and it does not see a contact that begins and ends between two points of the grid.

use lovines::{Drive, Parameters, State};
use roots::{SimpleConvergency, find_root_brent};

use crate::median;

/// Points of the grid per radian of the faster of drive and free oscillation: 24 per period.
const POINTS_PER_RADIAN: f64 = 24.0 / core::f64::consts::TAU;
/// Number of impacts between two points of the grid from which on it is a stall.
const MOST_IMPACTS: u32 = 1000;

/// The end of a chatter: impacts without end in no time.
#[derive(Clone, Copy, Debug)]
pub struct Stalled;

/// Velocities of primary mass and particle after an impact with the velocities `v1` and `v2`.
pub fn rebound(p: &Parameters, v1: f64, v2: f64) -> (f64, f64) {
    let (m1, m2) = (p.primary_mass, p.particle_mass);
    let (momentum, apart) = (m1 * v1 + m2 * v2, p.restitution * (v1 - v2));
    let after = (momentum - m2 * apart) / (m1 + m2);
    (after, after + apart)
}

/// The free oscillation about the particular solution: two amplitudes, by the sign of `zeta - 1`.
#[derive(Clone, Copy, Debug)]
enum Free {
    Under { delta: f64, omega: f64, a: f64, b: f64 },
    Over { first: f64, second: f64, a: f64, b: f64 },
}

/// The motion of the primary mass from an instant on: `M q1'' + c q1' + k q1 = k e + c e'` with `e = amplitude sin(omega t + phase)`.
#[derive(Clone, Copy, Debug)]
struct Trajectory {
    from: f64,
    free: Free,
    /// Particular solution `p sin + q cos` of `omega t + phase`; times `t` at an undamped resonance.
    p: f64,
    q: f64,
    secular: bool,
    omega: f64,
    phase: f64,
}

impl Trajectory {
    fn particular(&self, t: f64) -> (f64, f64) {
        let (sin, cos) = (self.omega * t + self.phase).sin_cos();
        let x = self.p * sin + self.q * cos;
        let v = self.omega * (self.p * cos - self.q * sin);
        if self.secular { (x * t, v * t + x) } else { (x, v) }
    }

    /// Of an oscillator from `[q, q']` at the time `from` of a step, under a base of this amplitude and angular frequency.
    fn of(oscillator: &Oscillator, (amplitude, omega): (f64, f64), phase: f64, from: f64) -> Self {
        let Oscillator { mass: m, stiffness: k, damping: c, participation, state, .. } = *oscillator;
        let amplitude = participation * amplitude;
        let (detuning, damping) = (k - m * omega * omega, c * omega);
        let square = detuning * detuning + damping * damping;
        let secular = square == 0.0 && amplitude != 0.0;
        let (p, q) = if amplitude == 0.0 {
            (0.0, 0.0)
        } else if secular {
            (0.0, -amplitude * k / (2.0 * m * omega))
        } else {
            let p = amplitude * (k * detuning + damping * damping) / square;
            (p, amplitude * (damping * detuning - k * damping) / square)
        };
        let delta = 0.5 * c / m;
        let free = Free::Under { delta, omega: 0.0, a: 0.0, b: 0.0 };
        let mut trajectory = Self { from, free, p, q, secular, omega, phase };
        let (xp, vp) = trajectory.particular(from);
        let (y, dy) = (state[0] - xp, state[1] - vp);
        let square = k / m - delta * delta;
        trajectory.free = if square > 0.0 {
            let omega = square.sqrt();
            Free::Under { delta, omega, a: y, b: (dy + delta * y) / omega }
        } else {
            let root = (-square).sqrt();
            let first = -delta - root;
            let second = k / m / first;
            let a = (dy - second * y) / (first - second);
            Free::Over { first, second, a, b: y - a }
        };
        trajectory
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

/// One of the oscillators whose displacements add up to that of the cavity: the study's, or a mode of a structure.
#[derive(Clone, Copy, Debug)]
pub struct Oscillator {
    /// Mass, kg.
    pub mass: f64,
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Damping, N s/m.
    pub damping: f64,
    /// Displacement of the cavity per displacement of this oscillator.
    pub shape: f64,
    /// Displacement of its base per displacement of the base.
    pub participation: f64,
    /// Displacement, m, and velocity, m/s.
    pub state: [f64; 2],
}

/// The method under way, with N oscillators as the host.
#[derive(Clone, Copy, Debug)]
pub struct Baseline<const N: usize = 1> {
    /// The host.
    pub host: [Oscillator; N],
    rig: Parameters,
    tolerance: f64,
    /// Displacement, m, and velocity, m/s, of the particle.
    pub particle: [f64; 2],
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
    /// One oscillator at `start`; impact instants are found to `tolerance` seconds.
    pub fn new(rig: Parameters, start: State, tolerance: f64) -> Self {
        let oscillator = Oscillator {
            mass: rig.primary_mass,
            stiffness: rig.stiffness,
            damping: rig.damping,
            shape: 1.0,
            participation: 1.0,
            state: [start.q1, start.dq1],
        };
        Self::of([oscillator], [start.q2, start.dq2], rig, tolerance)
    }
}

impl<const N: usize> Baseline<N> {
    /// Of a host, and the particle of `rig` in its cavity; impact instants are found to `tolerance` seconds.
    pub fn of(host: [Oscillator; N], particle: [f64; 2], rig: Parameters, tolerance: f64) -> Self {
        let (elapsed, impacts, time, drive, phase) = (0.0, 0, 0.0, (0.0, 0.0), 0.0);
        Self {
            host,
            rig,
            tolerance,
            particle,
            elapsed,
            impacts,
            time,
            drive,
            phase,
        }
    }

    /// Displacements and velocities of cavity and particle.
    pub fn state(&self) -> State {
        let part = |n: usize| self.host.iter().map(|one| one.shape * one.state[n]).sum();
        let [q2, dq2] = self.particle;
        State { q1: part(0), dq1: part(1), q2, dq2 }
    }

    fn trajectories(&self) -> [Trajectory; N] {
        self.host
            .map(|one| Trajectory::of(&one, self.drive, self.phase, self.time))
    }

    /// Advances by `duration` seconds under the harmonic part of `drive`, the phase going on.
    ///
    /// # Errors
    /// The end of a chatter.
    pub fn advance(&mut self, drive: Drive, duration: f64) -> Result<(), Stalled> {
        let Drive { amplitude, omega, .. } = drive;
        self.drive = (amplitude, omega);
        let end = duration;
        let natural = self.host.iter().map(|one| (one.stiffness / one.mass).sqrt());
        let grid = 1.0 / (POINTS_PER_RADIAN * natural.fold(omega, f64::max));
        let b = self.rig.half_width;
        let mut motion = self.trajectories();
        // Time since the flight's start, on a grid.
        let (mut h, mut stalled) = (0.0, 0);
        while h < end - self.time {
            let after = (h + grid).min(end - self.time);
            let [q2, dq2] = self.particle;
            let q1 = |h: f64| -> f64 { (0..N).map(|n| self.host[n].shape * motion[n].at(h).0).sum() };
            let w = |h: f64| q1(h) - (q2 + dq2 * h);
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
            self.move_to(&motion, hit);
            self.time += hit;
            self.impact(wall);
            motion = self.trajectories();
            h = 0.0;
            stalled += 1;
            if stalled > MOST_IMPACTS {
                return Err(Stalled);
            }
        }
        let gone = end - self.time;
        self.move_to(&motion, gone);
        self.particle[0] += self.particle[1] * gone;
        self.time = 0.0;
        self.elapsed += duration;
        self.phase = (self.phase + omega * duration) % core::f64::consts::TAU;
        Ok(())
    }

    fn move_to(&mut self, motion: &[Trajectory; N], h: f64) {
        for (oscillator, trajectory) in self.host.iter_mut().zip(motion) {
            oscillator.state = trajectory.at(h).into();
        }
    }

    /// An impact gives each oscillator its share of the impulse.
    fn impact(&mut self, wall: f64) {
        let State { q1, dq1, dq2, .. } = self.state();
        let Parameters { particle_mass: m, restitution, .. } = self.rig;
        let mobility: f64 = self.host.iter().map(|one| one.shape * one.shape / one.mass).sum();
        let impulse = -(1.0 + restitution) * (dq1 - dq2) / (mobility + 1.0 / m);
        for one in &mut self.host {
            one.state[1] += one.shape / one.mass * impulse;
        }
        self.particle = [q1 - wall, dq2 - impulse / m];
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
    Ok(median(costs))
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
    let early = if n.is_multiple_of(2) { Some(turn(first)?) } else { None };
    let second = turn(second)?;
    Ok([early.map_or_else(|| turn(first), Ok)?, second])
}
