//! Are tracked points right on rigs with effects that no part of the bench models?
//!
//! The rig has one effect at a time, or all of a real cavity: friction of the particle, unequal gaps, tilt, and a restitution that falls with the
//! speed, which the plant has; a shaker that lags and distorts, and a structure whose spring hardens, for which there is a simulation here
//! (Runge-Kutta of the fourth order, impacts located by bisection). The client has the scene of the ideal rig, and reads its sensors only. The
//! truth is the periodic motion of the same rig at phase resonance and the measured amplitude, by Newton's method. Rigs are drawn as in
//! `off_scene.rs`.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example unmodelled -- RIGS SEED SNR    # SNR: dB, or none; writes validation/unmodelled.csv
//! ```

mod common;

use std::f64::consts::TAU;

use common::{Failure, Found, STATISTICS, arguments, quantile, scene, statistics, uniform, write};
use lovines::{Cavity, Parameters, Plant, Restitution, cavity::GRAVITY};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;
use vines_model::{
    Dimensionless,
    orbit::{ContinuationLimits, Periodic, backbone},
};
use vines_testbench::{
    advice,
    backbone::{Point, track},
    comparison::ExactCurve,
    identification::Regime,
    rig::{BuiltIn, Chain, Drive, Rig, RigError, Sensors},
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
/// Largest sizes: friction and tilt over `b omega0²` (0.05 and 3 degrees on the default rig) and half of the difference of the gaps over b;
/// whether r = 1 - k |v|^(1/5), with the r of the scene at the usual relative speed 2; lag of the base, rad, and share of its harmonics, and the
/// cubic part of the spring at b.
const SIZES: [f64; 6] = [0.015, 0.05, 0.015, 1.0, 0.05, 0.003];
/// Steps of the simulation per period of the base, about.
const STEPS: f64 = 400.0;
/// Shortest time between two impacts, over 1/omega0.
const CHATTER: f64 = 1e-5;

/// (q1, q1', q2, q2'), with M = k = b = 1.
type State = [f64; 4];

/// A rig that can be started anywhere.
trait Motion: Sized {
    /// The motion of `scene` with the effects, in the units of [`SIZES`], from `state` at the phase 0 of the drive; `None` for a particle
    /// outside its cavity.
    fn start(scene: &Dimensionless, effects: [f64; 6], state: State, drive: Drive) -> Option<Self>;
    fn drive(&mut self, drive: Drive);
    /// Follows the motion for `duration`, over 1/omega0.
    fn follow(&mut self, duration: f64);
    fn state(&self) -> State;
    fn base(&self) -> f64;
}

/// The plant, with a real cavity.
struct RealCavity {
    plant: Plant,
    drive: Drive,
}

impl Motion for RealCavity {
    fn start(scene: &Dimensionless, effects: [f64; 6], [q1, dq1, q2, dq2]: State, drive: Drive) -> Option<Self> {
        let [friction, gaps, tilt, speed, ..] = effects;
        let viscoelastic = Restitution::Viscoelastic((1.0 - scene.r) / 2_f64.powf(0.2));
        let cavity = Cavity {
            b_plus: Some(1.0 + gaps),
            b_minus: Some(1.0 - gaps),
            // In SI units gravity is 9.8 b omega0² here.
            tilt: (tilt / GRAVITY).asin(),
            kinetic_friction: friction / GRAVITY,
            restitution: [(speed == 1.0).then_some(viscoelastic); 2],
            ..Cavity::IDEAL
        };
        let parameters = Parameters::dimensionless(scene.epsilon, scene.lambda, scene.r);
        let start = lovines::State { q1, dq1, q2, dq2 };
        let plant = Plant::new(Parameters { cavity, ..parameters }, start).ok()?;
        Some(Self { plant, drive })
    }

    fn drive(&mut self, drive: Drive) {
        self.drive = drive;
    }

    fn follow(&mut self, duration: f64) {
        let Drive { amplitude, omega, .. } = self.drive;
        let drive = lovines::Drive::harmonic(amplitude, omega);
        self.plant.advance(drive, duration).expect("a drive within its limits");
    }

    fn state(&self) -> State {
        let lovines::State { q1, dq1, q2, dq2 } = self.plant.state();
        [q1, dq1, q2, dq2]
    }

    fn base(&self) -> f64 {
        self.plant.base_displacement()
    }
}

/// A rig with another shaker and another spring.
struct Imperfect {
    scene: Dimensionless,
    /// Of the shaker and of the spring.
    effects: [f64; 2],
    state: State,
    /// Phase of the command, rad.
    phase: f64,
    drive: Drive,
}

impl Imperfect {
    /// Displacement and velocity of the base at a phase of the command.
    fn base_at(&self, phase: f64) -> [f64; 2] {
        let (lag, Drive { omega, amplitude, .. }) = (self.effects[0], self.drive);
        let parts = [(1.0, 1.0), (2.0, 0.5 * lag), (3.0, 0.5 * lag)].map(|(n, share)| {
            let (sine, cosine) = (n * (phase - lag)).sin_cos();
            [share * sine, n * omega * share * cosine]
        });
        [0, 1].map(|i| amplitude * parts.iter().map(|part| part[i]).sum::<f64>())
    }

    fn derivative(&self, [q1, dq1, _, dq2]: State, phase: f64) -> State {
        let Dimensionless { epsilon, lambda, .. } = self.scene;
        let [e, de] = self.base_at(phase);
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
}

impl Motion for Imperfect {
    fn start(scene: &Dimensionless, effects: [f64; 6], state: State, drive: Drive) -> Option<Self> {
        let [.., shaker, spring] = effects;
        Some(Self {
            scene: *scene,
            effects: [shaker, spring],
            state,
            phase: 0.0,
            drive,
        })
    }

    fn drive(&mut self, drive: Drive) {
        self.drive = drive;
    }

    fn state(&self) -> State {
        self.state
    }

    fn base(&self) -> f64 {
        self.base_at(self.phase)[0]
    }

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
}

/// A rig of a scene with effects, in the units of [`SIZES`].
#[derive(Clone, Copy)]
struct Case {
    scene: Dimensionless,
    effects: [f64; 6],
}

impl Case {
    fn response(&self, [q1, _, q2, _]: State) -> f64 {
        q1 + self.scene.epsilon * q2
    }

    /// Residual of the periodic motion at phase resonance with the amplitude `c`; `x`: state at the phase 0, E and omega.
    fn residual<M: Motion>(&self, x: &Vector6<f64>, c: f64) -> Option<Vector6<f64>> {
        let drive = Drive { amplitude: x[4], omega: x[5], ..Drive::default() };
        let mut rig = M::start(&self.scene, self.effects, [x[0], x[1], x[2], x[3]], drive)?;
        let samples = 64;
        let (mut response, mut base) = ([0.0; 2], [0.0; 2]);
        for n in 0..samples {
            let (sine, cosine) = (TAU * f64::from(n) / f64::from(samples)).sin_cos();
            // The plant's base is where the last drive left it: at the start, at 0, as that of this drive.
            let [v, e] = [self.response(rig.state()), rig.base()].map(|value| 2.0 / f64::from(samples) * value);
            response = [response[0] + v * cosine, response[1] - v * sine];
            base = [base[0] + e * cosine, base[1] - e * sine];
            rig.follow(TAU / drive.omega / f64::from(samples));
        }
        // In phase resonance the response lags the base by a quarter of a period.
        let across = (response[0] * base[0] + response[1] * base[1]) / base[0].hypot(base[1]);
        let end = rig.state();
        let [a, b, p, q]: State = std::array::from_fn(|n| end[n] - x[n]);
        Some([a, b, p, q, response[0].hypot(response[1]) - c, across].into())
    }

    /// `[sigma, G]` of phase resonance at the amplitude `c`, near `sigma`: from an exact orbit of the ideal rig, by effects that grow step by step.
    fn truth<M: Motion>(&self, orbits: &[Periodic], c: f64, sigma: f64) -> Option<[f64; 2]> {
        // The start of Newton's method only.
        let distance = |one: &Periodic| (one.c - c).hypot(one.sigma - sigma);
        let orbit = orbits.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let [q1, dq1, q2, dq2] = orbit.start(&Dimensionless { g: orbit.g, ..self.scene })?;
        let epsilon = self.scene.epsilon;
        let mut x = Vector6::from([q1, dq1, q2, dq2, epsilon * orbit.g, 1.0 + epsilon * orbit.sigma]);
        for grown in 0..=8 {
            let effects = self.effects.map(|effect| effect * f64::from(grown) / 8.0);
            // The middle of the cavity moves with its gaps.
            x[2] -= if grown > 0 { self.effects[1] / 8.0 } else { 0.0 };
            x = Self { effects, ..*self }.newton::<M>(x, c)?;
        }
        Some([(x[5] - 1.0) / epsilon, x[4] / epsilon])
    }

    fn newton<M: Motion>(&self, mut x: Vector6<f64>, c: f64) -> Option<Vector6<f64>> {
        for _ in 0..12 {
            let now = self.residual::<M>(&x, c)?;
            let mut matrix = Matrix6::zeros();
            for n in 0..6 {
                let h = 1e-7 * if n == 4 { self.scene.epsilon } else { 1.0 };
                let [mut up, mut down] = [x; 2];
                (up[n], down[n]) = (x[n] + h, x[n] - h);
                let column = (self.residual::<M>(&up, c)? - self.residual::<M>(&down, c)?) / (2.0 * h);
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

/// A rig of a case, whose sensor reads the response.
struct Driven<M>(Case, M);

impl<M: Motion> Rig for Driven<M> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors {
            response: self.0.response(self.1.state()),
            reference: Some(self.1.base()),
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.drive(drive);
        self.1.follow(step);
        Ok(())
    }
}

/// Counts the points, the settled ones, those whose truth was not found, and whether tracking ended early.
fn run<M: Motion + 'static>(case: Case, snr: &str, noise: u64) -> Result<Found, Failure> {
    let d = case.scene;
    let [low, high] = advice::stable_range(&d).ok_or("no stable orbit")?;
    let stable = advice::largest_stable(&d).ok_or("no stable orbit")?;
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
    let drive = Drive { omega: 1.0, ..Drive::default() };
    let rig = M::start(&d, case.effects, [0.0, 0.0, 0.0, 0.9], drive).ok_or("a start outside the cavity")?;
    let mut chain = Chain::around(Box::new(Driven(case, rig)), &scene);
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let tracked = track(chain.as_mut(), &mut controller, &scene, |_, _| {})?;
    let is_backbone = |regime| matches!(regime, Regime::Symmetric | Regime::Unresolved);
    let kept = |point: &&Point| point.settled && is_backbone(point.regime);
    let (mut found, mut settled, mut without) = (Found::default(), 0, 0);
    for Point { at, .. } in tracked.points.iter().filter(kept) {
        settled += 1;
        let Some([sigma, g]) = case.truth::<M>(&orbits, at.c, at.sigma) else {
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
        let cases: Vec<_> = (0..count.parse::<u64>()?)
            .map(|noise| {
                let epsilon = uniform(1e-3_f64.ln(), 0.02_f64.ln()).exp();
                let scene = Dimensionless::new(epsilon, uniform(0.7, 2.5), uniform(0.5, 0.8), 0.0);
                let mut sizes: [f64; 6] = std::array::from_fn(|m| {
                    let lowest = if m == 0 { 0.0 } else { -SIZES[m] };
                    uniform(lowest, SIZES[m])
                });
                sizes[3] = SIZES[3];
                let is_on = |m: usize| match n {
                    4 => m < 4,
                    n if n < 4 => m == n,
                    n => m == n - 1,
                };
                let effects = std::array::from_fn(|m| if is_on(m) { sizes[m] } else { 0.0 });
                (Case { scene, effects }, noise)
            })
            .collect();
        let one = |(case, noise): &(Case, u64)| {
            let found = if n < 5 {
                run::<RealCavity>(*case, snr, *noise)
            } else {
                run::<Imperfect>(*case, snr, *noise)
            };
            found.unwrap_or_else(|error| {
                println!("{:?}: {error}", case.scene);
                Found { counts: [0, 0, 0, 1], ..Found::default() }
            })
        };
        let (text, [points, settled, without, ended]) = statistics(&cases.par_iter().map(one).collect::<Vec<_>>());
        rows.push(format!(
            "{name},{count},{seed},{snr},{points},{settled},{without},{text},{ended}"
        ));
    }
    let header = format!("effect,rigs,seed,snr_dB,points,settled,without_truth,{STATISTICS},ended_early");
    write("unmodelled", &header, 4, &rows)
}
