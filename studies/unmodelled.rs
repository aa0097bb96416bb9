//! Are tracked points right on rigs with effects that no part of the bench models?
//!
//! The rig has one effect at a time, or all of a real cavity: friction of the particle, unequal gaps, tilt and a restitution that falls with the
//! speed, which the plant has; a shaker that lags and distorts, and a structure whose spring hardens, which are simulated here (Runge-Kutta of
//! the fourth order, impacts located by bisection). The client has the scene of the ideal rig, and reads its sensors only. The truth is the
//! periodic motion of the same rig at phase resonance and the measured amplitude, by Newton's method. Rigs are drawn as in `off_scene.rs`.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example unmodelled -- RIGS SEED SNR    # SNR: dB, or none; writes validation/unmodelled.csv
//! ```

mod common;

use std::f64::consts::TAU;

use common::{Failure, Found, STATISTICS, arguments, largest_stable, quantile, scene, statistics, uniform, write};
use lovines::{Cavity, Parameters, Restitution, cavity::GRAVITY};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;
use vines_model::{
    Dimensionless,
    orbit::{ContinuationLimits, Periodic, backbone, resonant_motion},
};
use vines_testbench::{
    advice,
    backbone::{LevelPoint, track},
    comparison::ExactCurve,
    identification::Regime,
    rig::{BuiltIn, Chain, Drive, Rig, RigError, Sensors, SensorsOnly, Simulated},
    scene::LinearResponse,
};

/// Names of the effects; "real cavity" is all of the first four.
const EFFECTS: [&str; 7] = [
    "friction",
    "unequal gaps",
    "tilt",
    "r of the speed",
    "real cavity",
    "shaker",
    "hardening spring",
];
/// Number of effects of the cavity.
const CAVITY: usize = 4;
/// Largest sizes: friction and tilt over `b omega0²` (0.05 and 3 degrees on the default rig), half of the difference of the gaps over b, a switch
/// (r = 1 - k |v|^(1/5), with the r of the scene at the relative speed 2, the usual one of a 1:1 motion); lag of the base, rad, and share of its
/// harmonics, and the cubic part of the spring at b.
const SIZES: [f64; 6] = [0.015, 0.05, 0.015, 1.0, 0.05, 0.003];
/// Steps of the simulation per period of the base, about.
const STEPS: f64 = 400.0;
/// Shortest time between two impacts, over 1/omega0.
const CHATTER: f64 = 1e-5;

/// (q1, q1', q2, q2'), with M = k = b = 1.
type State = [f64; 4];

/// The plant with effects of the cavity, in the units of [`SIZES`].
fn real_cavity(scene: &Dimensionless, [friction, gaps, tilt, speed]: [f64; CAVITY]) -> Parameters {
    let viscoelastic = Restitution::Viscoelastic((1.0 - scene.r) / 2_f64.powf(0.2));
    let cavity = Cavity {
        b_plus: Some(1.0 + gaps),
        b_minus: Some(1.0 - gaps),
        // Gravity is 9.8 b omega0² here.
        tilt: (tilt / GRAVITY).asin(),
        kinetic_friction: friction / GRAVITY,
        restitution: [(speed != 0.0).then_some(viscoelastic); 2],
        ..Cavity::IDEAL
    };
    let ideal = Parameters::dimensionless(scene.epsilon, scene.lambda, scene.r);
    Parameters { cavity, ..ideal }
}

/// A rig with another shaker and another spring.
#[derive(Clone, Copy)]
struct Imperfect {
    scene: Dimensionless,
    /// Of the shaker and of the spring, in the units of [`SIZES`].
    effects: [f64; 2],
    state: State,
    /// Phase of the command, rad.
    phase: f64,
    drive: Drive,
}

impl Imperfect {
    /// Displacement and velocity of the base at a phase of the command.
    fn base(&self, phase: f64) -> [f64; 2] {
        let (lag, Drive { omega, amplitude, .. }) = (self.effects[0], self.drive);
        let parts = [(1.0, 1.0), (2.0, 0.5 * lag), (3.0, 0.5 * lag)].map(|(n, share)| {
            let (sine, cosine) = (n * (phase - lag)).sin_cos();
            [share * sine, n * omega * share * cosine]
        });
        [0, 1].map(|i| amplitude * parts.iter().map(|part| part[i]).sum::<f64>())
    }

    fn derivative(&self, [q1, dq1, _, dq2]: State, phase: f64) -> State {
        let Dimensionless { epsilon, lambda, .. } = self.scene;
        let [e, de] = self.base(phase);
        let spring = (q1 - e) + self.effects[1] * (q1 - e).powi(3);
        [dq1, -spring - epsilon * lambda * (dq1 - de), dq2, 0.0]
    }

    fn step(&self, state: State, phase: f64, h: f64) -> State {
        let turn = self.drive.omega * h;
        let along = |slope: State, h: f64| std::array::from_fn(|n| state[n] + h * slope[n]);
        let k1 = self.derivative(state, phase);
        let k2 = self.derivative(along(k1, 0.5 * h), phase + 0.5 * turn);
        let k3 = self.derivative(along(k2, 0.5 * h), phase + 0.5 * turn);
        let k4 = self.derivative(along(k3, h), phase + turn);
        std::array::from_fn(|n| state[n] + h / 6.0 * (k1[n] + 2.0 * (k2[n] + k3[n]) + k4[n]))
    }

    /// How far the particle is inside the wall that it moves to; above 0 behind it.
    fn depth(&self, [q1, dq1, q2, dq2]: State) -> f64 {
        (dq1 - dq2).signum() * (q1 - q2) - 1.0
    }

    fn rebound(&self, [q1, dq1, q2, dq2]: State) -> State {
        let Dimensionless { epsilon, r, .. } = self.scene;
        let kick = (1.0 + r) * (dq1 - dq2) / (1.0 + epsilon);
        [q1, dq1 - epsilon * kick, q2, dq2 + kick]
    }

    /// Follows the motion for `duration`, over 1/omega0.
    fn follow(&mut self, duration: f64) {
        let steps = (duration * self.drive.omega * STEPS / TAU).ceil().max(1.0);
        for _ in 0..steps as usize {
            let mut left = duration / steps;
            while left > 0.0 {
                let mut h = left;
                let mut next = self.step(self.state, self.phase, h);
                let meets = self.depth(next) > 0.0;
                if meets {
                    let (mut low, mut high) = (0.0, h);
                    for _ in 0..45 {
                        h = 0.5 * (low + high);
                        let behind = self.depth(self.step(self.state, self.phase, h)) > 0.0;
                        (low, high) = if behind { (low, h) } else { (h, high) };
                    }
                    // In chatter, impacts that follow at once are one of this duration.
                    h = high.max(left.min(CHATTER));
                    next = self.rebound(self.step(self.state, self.phase, h));
                }
                self.state = next;
                self.phase += self.drive.omega * h;
                left = if meets { left - h } else { 0.0 };
            }
        }
    }

    fn response(&self) -> f64 {
        self.state[0] + self.scene.epsilon * self.state[2]
    }

    /// Residual of the periodic motion at phase resonance with the amplitude `c`; `x`: state at the phase 0, E and omega.
    fn residual(&self, x: &Vector6<f64>, c: f64) -> Vector6<f64> {
        let drive = Drive { amplitude: x[4], omega: x[5], ..Drive::default() };
        let mut rig = Self { state: [x[0], x[1], x[2], x[3]], phase: 0.0, drive, ..*self };
        let samples = 64;
        let (mut response, mut base) = ([0.0; 2], [0.0; 2]);
        for _ in 0..samples {
            let (sine, cosine) = rig.phase.sin_cos();
            let [v, e] = [rig.response(), rig.base(rig.phase)[0]].map(|value| 2.0 / f64::from(samples) * value);
            response = [response[0] + v * cosine, response[1] - v * sine];
            base = [base[0] + e * cosine, base[1] - e * sine];
            rig.follow(TAU / drive.omega / f64::from(samples));
        }
        let end = rig.state;
        // In phase resonance the response lags the base by a quarter of a period.
        let across = (response[0] * base[0] + response[1] * base[1]) / base[0].hypot(base[1]);
        let closing: [f64; 4] = std::array::from_fn(|n| end[n] - x[n]);
        let [a, b, p, q] = closing;
        [a, b, p, q, response[0].hypot(response[1]) - c, across].into()
    }

    /// `[sigma, G]` of phase resonance at the amplitude `c`, near `sigma`: from an exact orbit of the ideal rig, by effects that grow step by step.
    fn truth(&self, orbits: &[Periodic], c: f64, sigma: f64) -> Option<[f64; 2]> {
        // The start of Newton's method only.
        let distance = |one: &Periodic| (one.c - c).hypot(one.sigma - sigma);
        let orbit = orbits.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let [q1, dq1, q2, dq2] = orbit.start(&Dimensionless { g: orbit.g, ..self.scene })?;
        let epsilon = self.scene.epsilon;
        let mut x = Vector6::from([q1, dq1, q2, dq2, epsilon * orbit.g, 1.0 + epsilon * orbit.sigma]);
        for grown in 0..=8 {
            let effects = self.effects.map(|effect| effect * f64::from(grown) / 8.0);
            x = Self { effects, ..*self }.newton(x, c)?;
        }
        Some([(x[5] - 1.0) / epsilon, x[4] / epsilon])
    }

    fn newton(&self, mut x: Vector6<f64>, c: f64) -> Option<Vector6<f64>> {
        for _ in 0..12 {
            let now = self.residual(&x, c);
            let mut matrix = Matrix6::zeros();
            for n in 0..6 {
                let h = 1e-7 * if n == 4 { self.scene.epsilon } else { 1.0 };
                let [mut up, mut down] = [x; 2];
                (up[n], down[n]) = (x[n] + h, x[n] - h);
                let column = (self.residual(&up, c) - self.residual(&down, c)) / (2.0 * h);
                matrix.set_column(n, &column);
            }
            let change = matrix.lu().solve(&now)?;
            x -= change;
            if change.amax() > 0.3 {
                return None;
            }
            if change.amax() < 1e-9 {
                return Some(x);
            }
        }
        None
    }
}

impl Rig for Imperfect {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors {
            response: self.response(),
            reference: Some(self.base(self.phase)[0]),
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.drive = drive;
        self.follow(step);
        Ok(())
    }
}

/// Counts the points, the settled ones, those whose truth was not found, and whether tracking ended early.
fn run(d: Dimensionless, effects: [f64; 6], snr: &str, noise: u64) -> Result<Found, Failure> {
    let [low, high] = advice::stable_range(&d).ok_or("no stable orbit")?;
    let stable = largest_stable(&d).ok_or("no stable orbit")?;
    let curve = ExactCurve::of(&d);
    let fold = curve.places().first().ok_or("no backbone")?[0];
    let orbits = backbone(&d, &ContinuationLimits::default())
        .ok_or("no backbone")?
        .points;
    let settings = [
        format!("plant.epsilon={:?}", d.epsilon),
        format!("plant.lambda={:?}", d.lambda),
        format!("plant.r={:?}", d.r),
        format!("excitation.G={:?}", 0.5 * (low + high)),
        "start.dq2=0.9".into(),
        "controller.omega_min=0.8".into(),
        "controller.omega_max=1.2".into(),
        format!("backbone.C_from={:?}", 0.95 * stable.min(0.75)),
        format!("backbone.C_to={:?}", 1.1 * fold),
        "backbone.points=15".into(),
        "backbone.G_max=20".into(),
        format!("chain.snr={snr}"),
        format!("chain.seed={noise}"),
    ];
    let mut scene = scene("[plant]\n[start]\n[excitation]\n", &settings)?;
    // As a loop check measures it.
    scene.measured = Some(LinearResponse::of(&scene));
    let [friction, gaps, tilt, speed, shaker, spring] = effects;
    let parameters = real_cavity(&d, [friction, gaps, tilt, speed]);
    let imperfect = Imperfect {
        scene: d,
        effects: [shaker, spring],
        state: [0.0, 0.0, 0.0, 0.9],
        phase: 0.0,
        drive: Drive { omega: 1.0, ..Drive::default() },
    };
    let is_simulated_here = imperfect.effects != [0.0; 2];
    let rig: Box<dyn Rig> = if is_simulated_here {
        Box::new(imperfect)
    } else {
        let start = lovines::State { dq2: 0.9, ..Default::default() };
        Box::new(SensorsOnly::around(Box::new(Simulated::new(parameters, start)?)))
    };
    let truth = |c: f64, sigma: f64| {
        if is_simulated_here {
            return imperfect.truth(&orbits, c, sigma);
        }
        let motion = resonant_motion(&parameters, d.definition, c, None).ok()?;
        Some([d.sigma(motion.omega), d.excitation(motion.amplitude)])
    };
    let mut chain = Chain::around(rig, &scene);
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let tracked = track(chain.as_mut(), &mut controller, &scene, |_, _| {})?;
    let is_backbone = |regime| matches!(regime, Regime::Symmetric | Regime::Unresolved);
    let kept = |point: &&LevelPoint| point.settled && is_backbone(point.regime);
    let (mut found, mut settled, mut without) = (Found::default(), 0, 0);
    for LevelPoint { at, .. } in tracked.points.iter().filter(kept) {
        settled += 1;
        let Some([sigma, g]) = truth(at.c, at.sigma) else {
            without += 1;
            continue;
        };
        let errors = [(at.sigma - sigma).abs(), (at.g - g).abs()];
        found.ratios.extend([errors[0] / at.u_sigma, errors[1] / at.u_g]);
        found.errors.push(errors[0].max(errors[1]));
    }
    let why = tracked.ended.as_ref().map_or_else(String::new, ToString::to_string);
    println!("{d:?}: worst {:.1} u {why}", quantile(&found.ratios, 1.0));
    let count = tracked.points.len();
    found.periods = (count > 0).then(|| tracked.periods / count as f64);
    found.counts = [count, settled, without, usize::from(tracked.ended.is_some())];
    Ok(found)
}

fn main() -> Result<(), Failure> {
    let [count, seed, snr] = &arguments()[..] else {
        return Err("arguments: RIGS SEED SNR|none".into());
    };
    let mut uniform = uniform(seed.parse()?);
    let mut rows = Vec::new();
    for (n, name) in EFFECTS.into_iter().enumerate() {
        let rigs: Vec<_> = (0..count.parse::<u64>()?)
            .map(|noise| {
                let epsilon = uniform(1e-3_f64.ln(), 0.02_f64.ln()).exp();
                let d = Dimensionless::new(epsilon, uniform(0.7, 2.5), uniform(0.5, 0.8), 0.0);
                let effects = std::array::from_fn(|m| {
                    let lowest = if [0, 3].contains(&m) { 0.0 } else { -SIZES[m] };
                    let size = uniform(lowest, SIZES[m]);
                    let is_on = match n {
                        CAVITY => m < CAVITY,
                        n if n < CAVITY => m == n,
                        n => m == n - 1,
                    };
                    if is_on { size } else { 0.0 }
                });
                (d, effects, noise)
            })
            .collect();
        let one = |(d, effects, noise): &(Dimensionless, [f64; 6], u64)| {
            run(*d, *effects, snr, *noise).unwrap_or_else(|error| {
                println!("{d:?}: {error}");
                Found { counts: [0, 0, 0, 1], ..Found::default() }
            })
        };
        let (text, [points, settled, without, ended]) = statistics(&rigs.par_iter().map(one).collect::<Vec<_>>());
        rows.push(format!(
            "{name},{count},{seed},{snr},{points},{settled},{without},{text},{ended}"
        ));
    }
    let header = format!("effect,rigs,seed,snr_dB,points,settled,without_truth,{STATISTICS},ended_early");
    write("unmodelled", &header, 4, &rows)
}
