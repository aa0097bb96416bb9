//! Does a fit take a system without a vibro-impact cavity for one with it?
//!
//! Records of systems whose scene describes a cavity: a linear mode; a hardening spring; dry friction on the mass; a spring with play; a particle between
//! soft walls; two particles with different cavities. Fourth-order Runge-Kutta method, impacts by bisection; nothing of it is the plant's. f0, epsilon,
//! lambda, r and b are drawn as in `hypotheses`, and the scene is as wrong as there.
//!
//! `refused`: no stretch of the record is symmetric 1:1 with impacts. `excluded`: no hypothesis is possible. `cavity`: one is, so that `vines fit` ends
//! with exit code 0, and the names of the best.
//!
//! Arguments: RIGS, SEED. Writes validation/other_systems.csv.

mod common;
mod recorder;

use std::f64::consts::TAU;

use common::*;
use lovines::Drive;
use recorder::*;
use vines_bench::fit::{Measurements, find};
use vines_identify::IdealRig;

/// What acts on the mass beside its spring and damper; lengths are over b, forces over the stiffness.
#[derive(Debug, Clone, Copy)]
enum Element {
    Linear,
    /// Share of the stiffness that a response of b adds.
    Hardening(f64),
    /// Force against the velocity.
    DryFriction(f64),
    /// Stiffness over the linear one, and play.
    Play([f64; 2]),
    /// Frequency of the contact over f0.
    SoftWall(f64),
    /// Half-width of the second cavity over the first.
    TwoParticles(f64),
}

const NAMES: [&str; 6] = [
    "linear",
    "hardening spring",
    "dry friction",
    "spring with play",
    "soft walls",
    "two particles",
];

fn drawn_element(uniform: Uniform, n: usize, zeta: f64) -> Element {
    match n {
        0 => Element::Linear,
        1 => Element::Hardening(uniform(0.005, 0.1)),
        2 => Element::DryFriction(zeta * uniform(0.1, 0.5)),
        3 => Element::Play([uniform(0.01, 0.1), uniform(0.1, 0.4)]),
        4 => Element::SoftWall(uniform(10.0, 60.0)),
        _ => Element::TwoParticles(uniform(1.1, 1.6)),
    }
}

/// Displacement and velocity of the mass and of two particles.
type Motion = [f64; 6];

struct Other {
    rig: IdealRig,
    element: Element,
    motion: Motion,
}

/// Steps from sample to sample.
const STEPS: u32 = 20;

impl Other {
    /// Masses over that of the mass, and half-widths, of the particles between hard walls.
    fn particles(&self) -> Vec<[f64; 2]> {
        let IdealRig { epsilon, b, .. } = self.rig;
        match self.element {
            Element::TwoParticles(wider) => vec![[0.5 * epsilon, b], [0.5 * epsilon, wider * b]],
            _ => Vec::new(),
        }
    }

    fn rates(&self, [y, v, x, dx, _, dx2]: Motion, [base, growth]: [f64; 2]) -> Motion {
        let IdealRig { f0, zeta, r, b, epsilon } = self.rig;
        let omega0 = TAU * f0;
        let beyond = |y: f64, play: f64| y - y.clamp(-play, play);
        let mut particle = 0.0;
        let element = match self.element {
            Element::Linear | Element::TwoParticles(_) => 0.0,
            Element::Hardening(share) => -share * y.powi(3) / (b * b),
            Element::DryFriction(force) => -force * b * (v / (1e-3 * b * omega0)).tanh(),
            Element::Play([stiffness, play]) => -stiffness * beyond(y, play * b),
            Element::SoftWall(ratio) => {
                let depth = beyond(y - x, b);
                // The damper of a contact with the restitution r.
                let log = r.ln();
                let damping = -2.0 * log / log.hypot(0.5 * TAU);
                let force = ratio * ratio * depth + ratio * damping * (v - dx) / omega0;
                // Walls do not pull.
                let force = if depth * force > 0.0 { force } else { 0.0 };
                particle = omega0 * omega0 * force;
                -epsilon * force
            }
        };
        let a = omega0 * omega0 * (base - y + element) + 2.0 * zeta * omega0 * (growth - v);
        [v, a, dx, particle, dx2, 0.0]
    }

    fn advanced(&self, from: f64, h: f64, base: &Drive) -> Motion {
        let [c0, c1, c2, c3] = base.signal;
        let at = |t: f64| [c0 + t * (c1 + t * (c2 + t * c3)), c1 + t * (2.0 * c2 + t * 3.0 * c3)];
        let moved = |by: &Motion, h: f64| std::array::from_fn(|i| self.motion[i] + h * by[i]);
        let k1 = self.rates(self.motion, at(from));
        let k2 = self.rates(moved(&k1, 0.5 * h), at(from + 0.5 * h));
        let k3 = self.rates(moved(&k2, 0.5 * h), at(from + 0.5 * h));
        let k4 = self.rates(moved(&k3, h), at(from + h));
        std::array::from_fn(|i| self.motion[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }

    /// Moves to the first impact, or for `h` seconds; returns how long, `least` if the impact is at once.
    fn step(&mut self, from: f64, h: f64, least: f64, base: &Drive) -> f64 {
        let particles = self.particles();
        let outside = |motion: &Motion| {
            let is_outside = |n: &usize| (motion[0] - motion[2 + 2 * n]).abs() > particles[*n][1];
            (0..particles.len()).find(is_outside)
        };
        let after = self.advanced(from, h, base);
        if outside(&after).is_none() {
            self.motion = after;
            return h;
        }
        let (mut low, mut high) = (0.0, h);
        for _ in 0..50 {
            let half = 0.5 * (low + high);
            match outside(&self.advanced(from, half, base)) {
                None => low = half,
                Some(_) => high = half,
            }
        }
        let hit = outside(&self.advanced(from, high, base)).unwrap_or(0);
        // A particle that comes to rest at a wall hits it without end: it goes on by a thousandth of a step at least.
        let moved = low.max(h.min(least));
        self.motion = self.advanced(from, moved, base);
        let (ratio, dx) = (particles[hit][0], 3 + 2 * hit);
        let approach = self.motion[1] - self.motion[dx];
        if approach * (self.motion[0] - self.motion[dx - 1]) > 0.0 {
            let jump = (1.0 + self.rig.r) * approach / (1.0 + ratio);
            self.motion[1] -= ratio * jump;
            self.motion[dx] += jump;
        }
        moved
    }
}

impl System for Other {
    fn response(&self) -> f64 {
        self.motion[0]
    }

    fn advance(&mut self, base: Drive, h: f64, _: &mut Vec<(f64, bool)>) -> Result<(), Failure> {
        let step = h / f64::from(STEPS);
        for n in 0..STEPS {
            let (begin, mut done) = (f64::from(n) * step, 0.0);
            while done < step {
                done += self.step(begin + done, step - done, 1e-3 * step, &base);
            }
        }
        Ok(())
    }
}

fn main() -> Result<(), Failure> {
    let [rigs, seed] = &arguments(["RIGS", "SEED"])?;
    let (rigs, seed): (usize, u64) = (rigs.parse()?, seed.parse()?);
    let default = scene("", &["resonance.sensor=q1"])?;
    let mut lines = Vec::new();
    for (number, name) in NAMES.into_iter().enumerate() {
        for snr in [60.0, 40.0] {
            let one = |n: usize| -> Result<_, Failure> {
                let own = seed * 1_000_000 + (number * 10_000 + n) as u64;
                let mut uniform = uniform(own);
                let mut logarithmic = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
                let [f0, epsilon, b] =
                    [[2.0, 80.0], [0.003, 0.03], [0.002, 0.02]].map(|[low, high]| logarithmic(low, high));
                let (zeta, r) = (0.5 * epsilon * uniform(0.4, 2.5), uniform(0.35, 0.8));
                let element = drawn_element(&mut uniform, number, zeta);
                let mut wrong = |most: f64| 1.0 + uniform(-most, most);
                let about = [
                    f0 * wrong(0.01),
                    zeta * wrong(0.25),
                    epsilon * wrong(0.15),
                    r * wrong(0.15),
                    b * wrong(0.1),
                ];
                let rig = IdealRig { f0, zeta, r, b, epsilon };
                let levels = schedule("mix", &rig)?;
                let speed = b * TAU * f0;
                let start = [0.0, 0.95 * levels[0] * speed, 0.0, 0.9 * speed, 0.0, 0.9 * speed];
                let mut system = Other { rig, element, motion: start };
                let found = recorded(&mut system, &rig, &levels, [snr, own as f64])?;
                let recordings = vec![recording(found.response, found.base, found.sample_time)];
                let scene = Scene { plant: parameters(about, Cavity::IDEAL), ..default.clone() };
                let measured = Measurements { recordings, ..Measurements::default() };
                Ok(find(&measured, &scene, |_| {}).ok().map(|found| {
                    let best = found.hypotheses.best().hypothesis.names()[0];
                    found.hypotheses.describes().then_some(best)
                }))
            };
            let all = (0..rigs).into_par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
            let refused = all.iter().filter(|one| one.is_none()).count();
            let cavity: Vec<&str> = all.iter().flatten().flatten().copied().collect();
            let line = format!(
                "{name},{snr},{seed},{rigs},{refused},{},{},{}",
                rigs - refused - cavity.len(),
                cavity.len(),
                cavity.join("; ")
            );
            println!("{line}");
            lines.push(line);
        }
    }
    write(
        "other_systems",
        "system,snr_dB,seed,rigs,refused,excluded,cavity,named",
        3,
        &lines,
    )
}
