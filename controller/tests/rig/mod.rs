//! A linear resonator on a moving base, exact between samples, and a control loop around it.
#![allow(dead_code)] // each test binary uses a part of it

use phase_lock::{Config, Input, Move, Output, PhaseLock, State};

pub const OMEGA_0: f64 = 55.39;
/// Damping ratio: the response relaxes with a time constant of 1/(2 pi ZETA) = 32 periods.
pub const ZETA: f64 = 0.005;
pub const AMPLITUDE: f64 = 1e-4;

/// `q'' + 2 zeta omega0 q' + omega0^2 q = omega0^2 e`, `e = E sin(phase)`, in closed form.
///
/// The base acts through the spring only, so phase resonance (a lag of pi/2) is exactly at omega0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Resonator {
    pub omega_0: f64,
    pub zeta: f64,
    pub q: f64,
    pub dq: f64,
    pub phase: f64,
    pub base: f64,
}

impl Resonator {
    pub fn new() -> Self {
        Self { omega_0: OMEGA_0, zeta: ZETA, ..Self::default() }
    }

    /// Advances under a base oscillator of amplitude `e`, m, and frequency `omega`, rad/s.
    pub fn advance(&mut self, e: f64, omega: f64, h: f64) {
        let (w, z) = (self.omega_0, self.zeta);
        // Steady state: q = Im(a exp(i phase)).
        let (re, im) = (w * w - omega * omega, 2.0 * z * w * omega);
        let scale = w * w * e / (re * re + im * im);
        let steady = |phase: f64| {
            let (s, c) = phase.sin_cos();
            let q = scale * (re * s - im * c);
            (q, scale * omega * (re * c + im * s))
        };
        let (q_p, dq_p) = steady(self.phase);
        let (x, v) = (self.q - q_p, self.dq - dq_p);
        // Free decay of the transient.
        let wd = w * (1.0 - z * z).sqrt();
        let (s, c) = (wd * h).sin_cos();
        let decay = (-z * w * h).exp();
        let b = (v + z * w * x) / wd;
        let free = decay * (x * c + b * s);
        let dfree = -z * w * free + decay * wd * (b * c - x * s);
        self.phase = (self.phase + omega * h) % std::f64::consts::TAU;
        let (q_p, dq_p) = steady(self.phase);
        (self.q, self.dq) = (free + q_p, dfree + dq_p);
        self.base = e * self.phase.sin();
    }
}

pub fn config() -> Config {
    Config::for_resonance(OMEGA_0, AMPLITUDE)
}

/// A controller and its state, coupled to a resonator.
#[derive(Clone, Copy)]
pub struct Bench {
    pub controller: PhaseLock,
    pub state: State,
    pub resonator: Resonator,
    pub active: bool,
    pub measured_reference: bool,
}

impl Bench {
    pub fn new(config: Config) -> Self {
        let controller = config.build().expect("a sensible configuration");
        let state = controller.start();
        Self {
            controller,
            state,
            resonator: Resonator::new(),
            active: true,
            measured_reference: true,
        }
    }

    /// A bench that has locked.
    pub fn locked(config: Config) -> Self {
        let mut bench = Self::new(config);
        bench.run_to_lock(3000).expect("a lock");
        bench
    }

    /// One sample: the sensor readings, and the drive until the next sample.
    pub fn sample(&mut self) -> Output {
        let reference = self.measured_reference.then_some(self.resonator.base);
        self.sample_reading(self.resonator.q, reference)
    }

    /// One sample with other sensor readings.
    pub fn sample_reading(&mut self, response: f64, reference: Option<f64>) -> Output {
        let input = Input { response, reference, active: self.active };
        let output = self.controller.process(&mut self.state, input);
        let h = self.controller.config().sample_time;
        self.resonator.advance(output.amplitude, output.omega, h);
        output
    }

    /// One sample with readings of response and base that pass through `fault`.
    pub fn sample_through(&mut self, fault: impl Fn(f64, f64) -> [f64; 2]) -> Output {
        let [response, base] = fault(self.resonator.q, self.resonator.base);
        self.sample_reading(response, Some(base))
    }

    /// Controls the response amplitude instead of the drive's, with a move to a new setpoint.
    pub fn hold(&mut self, to: Move) {
        let held = self.controller.hold_response(&mut self.state, to);
        held.expect("a closed loop");
    }

    /// Changes the drive amplitude, m, and the phase target, rad.
    pub fn retune(&mut self, amplitude: f64, phase_target: f64) {
        let retuned = self.controller.retune(amplitude, phase_target);
        retuned.expect("within limits");
    }

    /// Runs for a number of nominal periods. Returns the last output.
    pub fn run(&mut self, periods: u32) -> Output {
        (0..100 * periods)
            .map(|_| self.sample())
            .last()
            .expect("at least one sample")
    }

    /// Runs until locked. Returns the number of periods and the output.
    pub fn run_to_lock(&mut self, most_periods: u32) -> Option<(f64, Output)> {
        (0..100 * most_periods).find_map(|n| {
            let output = self.sample();
            output.locked.then_some((f64::from(n) / 100.0, output))
        })
    }
}

/// A reproducible sequence of uniform numbers in [-1, 1).
pub fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut random = fastrand::Rng::with_seed(seed);
    move || 2.0 * random.f64() - 1.0
}
