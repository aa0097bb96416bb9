//! Random structures: one to eight modes, any shapes, base or force, all effects of the cavity, a new drive at every sample.

use crate::figures::{ANY, Figures};
use crate::scenes::decades;
use lovines::host::Equations;
use lovines::plant::{MOST_IMPACTS, MOST_RELEASES};
use lovines::{
    Cavity, Drive, Event, Excitation, Host, Mode, Parameters, Plant, Restitution, Structure, StructureState,
};
use proptest::prelude::*;
use proptest::strategy::BoxedStrategy;
use std::f64::consts::TAU;

/// Steps for which each structure is followed, and number of impacts after which it is followed no further.
const STEPS: usize = 40;
const IMPACTS_FOLLOWED: u64 = 20_000;
/// Instants inside a step at which the particle must be between its walls, as parts of the step.
const LOOKS: [f64; 3] = [0.181_818, 0.618_034, 0.927_051];

/// A structure, its particle and start, and how it is driven and stepped.
#[derive(Clone, Debug)]
pub struct Scene {
    excitation: Excitation,
    modes: Vec<Mode>,
    /// Damping between the first coordinates, which couples the modes and can make them overdamped; 0: modal damping.
    coupling: f64,
    parameters: Parameters,
    start: StructureState,
    /// Where the particle starts in the cavity, from -1 to 1.
    place: f64,
    amplitude: f64,
    omega: f64,
    step: f64,
    seed: u64,
}

fn modes() -> impl Strategy<Value = Vec<Mode>> {
    let ratio = prop_oneof![1 => Just(1.01), 4 => 1.01..8.0f64, 1 => 8.0..30.0f64];
    let zeta = prop_oneof![1 => Just(0.0), 3 => decades(-5.0, -1.0), 1 => 0.1..0.2f64];
    let shape = prop_oneof![6 => -1.5..1.5f64, 1 => Just(0.0), 1 => decades(-6.0, 0.0)];
    let mode = (ratio, zeta, shape, -1.5..1.5f64);
    let undamped = prop_oneof![4 => Just(false), 1 => Just(true)];
    (prop::collection::vec(mode, 1..=8), 0.2..1.5f64, undamped).prop_map(|(modes, first, undamped)| {
        let mut omega = 1.0;
        let of = |(n, (ratio, zeta, cavity, drive)): (usize, (f64, f64, f64, f64))| {
            if n > 0 {
                // All ratios to the first mode stay below 1,000.
                omega *= if omega * ratio < 1e3 { ratio } else { 1.01 };
            }
            Mode {
                omega,
                zeta: if undamped { 0.0 } else { zeta },
                cavity: if n == 0 { first } else { cavity },
                drive,
            }
        };
        modes.into_iter().enumerate().map(of).collect()
    })
}

fn cavity() -> impl Strategy<Value = Cavity> {
    let mu = prop_oneof![2 => Just(0.0), 1 => decades(-5.0, -1.0)];
    let law = prop_oneof![
        4 => Just(None),
        1 => (0.1..1.0f64).prop_map(|r| Some(Restitution::Constant(r))),
        1 => (0.0..0.5f64).prop_map(|k| Some(Restitution::Viscoelastic(k))),
        1 => decades(-3.0, 0.0).prop_map(|v| Some(Restitution::Plastic(v))),
    ];
    let gap = prop_oneof![2 => Just(None), 1 => (0.3..1.5f64).prop_map(Some)];
    let tilt = prop_oneof![2 => Just(0.0), 1 => -0.05..0.05f64];
    (
        mu,
        1.0..2.0f64,
        law,
        gap,
        tilt,
        prop_oneof![3 => Just(0.0), 1 => 0.0..0.1f64],
    )
        .prop_map(|(mu, held, law, gap, tilt, scatter)| Cavity {
            kinetic_friction: mu,
            static_friction: (held > 1.5).then_some(mu * held),
            restitution: [law, None],
            b_plus: gap,
            tilt,
            scatter,
            ..Cavity::IDEAL
        })
}

pub fn scenes() -> BoxedStrategy<Scene> {
    let r = prop_oneof![4 => 0.05..0.98f64, 1 => Just(0.65), 1 => Just(1.0)];
    let coupling = prop_oneof![3 => Just(0.0), 1 => decades(-2.0, 1.5)];
    let place = prop_oneof![4 => -1.0..1.0f64, 1 => Just(1.0), 1 => Just(-1.0)];
    let structure = (any::<bool>(), modes(), coupling);
    let particle = (decades(-4.0, 0.0), r, cavity(), place, -2.0..2.0f64);
    let drive = (
        decades(-4.0, 0.5),
        prop_oneof![3 => 0.1..3.0f64, 1 => -1.0..30.0f64, 1 => Just(0.0)],
        any::<bool>(),
    );
    (
        structure,
        particle,
        drive,
        decades(-2.0, 1.0),
        any::<u64>(),
        prop::collection::vec(-1.0..1.0f64, 16),
    )
        .prop_map(|((base, modes, coupling), particle, drive, step, seed, state)| {
            let (m, r, cavity, place, dq2) = particle;
            let parameters = Parameters {
                particle_mass: m,
                cavity,
                ..Parameters::dimensionless(0.01, 1.0, r)
            };
            let n = modes.len();
            let velocities = (0..n).map(|k| state[8 + k] / (1 + k) as f64).collect();
            let displacements = (0..n).map(|k| state[k] / modes[k].omega).collect();
            let (amplitude, omega, driven) = drive;
            Scene {
                excitation: if base { Excitation::Base } else { Excitation::Force },
                modes,
                coupling,
                parameters,
                start: StructureState { displacements, velocities, q2: 0.0, dq2 },
                place,
                amplitude: if driven { amplitude } else { 0.0 },
                omega,
                step,
                seed,
            }
        })
        .boxed()
}

impl Scene {
    fn host(&self) -> Host {
        let n = self.modes.len();
        if self.coupling == 0.0 || n == 1 {
            return Host::from_modes(self.excitation, &self.modes).expect("a valid structure");
        }
        let square = |entry: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
        };
        let diagonal = |of: &dyn Fn(&Mode) -> f64| square(&|i, j| if i == j { of(&self.modes[i]) } else { 0.0 });
        let weight = |i: usize| if i < 2 { 1.0 - 1.7 * i as f64 } else { 0.0 };
        let damper = square(&|i, j| self.coupling * weight(i) * weight(j));
        let modal = diagonal(&|mode| 2.0 * mode.zeta * mode.omega);
        let row = |of: fn(&Mode) -> f64| -> Vec<f64> { self.modes.iter().map(of).collect() };
        let equations = Equations::Matrices {
            mass: diagonal(&|_| 1.0),
            damping: square(&|i, j| modal[i][j] + damper[i][j]),
            stiffness: diagonal(&|mode| mode.omega * mode.omega),
            cavity: row(|mode| mode.cavity),
            drive: row(|mode| mode.drive),
            states: vec![],
        };
        equations.host(self.excitation).expect("a valid structure")
    }

    fn plant(&self) -> Plant<Structure> {
        let host = self.host();
        let row = host
            .row(&self.modes.iter().map(|mode| mode.cavity).collect::<Vec<_>>())
            .expect("a point");
        let state = host.state(&self.start.displacements, &[], 0.0).expect("a start");
        let q1: f64 = row.iter().zip(&state).map(|([a, b], [x, v])| a * x + b * v).sum();
        let [plus, minus] = self.parameters.gaps();
        let w = if self.place > 0.0 {
            self.place * plus
        } else {
            self.place * minus
        };
        let at = |w: f64| {
            let start = StructureState { q2: q1 - w, ..self.start.clone() };
            Plant::with_host(host.clone(), self.parameters, &start)
        };
        // The rounding of q1 can put a particle on a wall outside of it.
        at(w).or_else(|_| at(w * (1.0 - 1e-13))).expect("a valid scene")
    }

    /// The drive of a step: of a new amplitude, frequency, offset and slope, or none.
    fn drive(&self, n: usize) -> Drive {
        if self.amplitude == 0.0 {
            return Drive::default();
        }
        let random = |k: u64| lovines::cavity::deviate(self.seed, 8 * n as u64 + k);
        let signal =
            [0.1 * random(0), 0.05 * random(1), 0.01 * random(2), 0.001 * random(3)].map(|u| u * self.amplitude);
        let omega = self.omega * (1.0 + 0.05 * random(5));
        Drive {
            signal,
            ..Drive::harmonic(self.amplitude * (1.0 + 0.2 * random(4)), omega)
        }
    }
}

/// How far the particle is outside the cavity by its relative displacement, in half-widths.
fn outside_by(plant: &Plant<Structure>, rounding: f64) -> f64 {
    let [plus, minus] = plant.parameters().gaps();
    let w = plant.relative_displacement();
    ((w - plus).max(-w - minus) - rounding) / (0.5 * (plus + minus))
}

#[expect(clippy::too_many_lines, reason = "a test")]
fn once(s: &Scene, saved: bool, figures: &mut Figures) -> Plant<Structure> {
    let mut plant = s.plant();
    let fastest = plant
        .host()
        .sections()
        .iter()
        .map(|section| section.oscillator.fastest)
        .fold(0.0, f64::max);
    let at_start = plant.energy();
    let (mut before, mut largest) = (at_start, at_start.abs());
    for n in 0..STEPS {
        if saved {
            let state = plant.save();
            plant = s.plant();
            plant.restore(&state);
        }
        let drive = s.drive(n);
        let (mut impacts, mut backwards) = (0u64, 0);
        let mut looked = plant.clone();
        let see = |event| {
            if let Event::Impact { wall, velocity, .. } = event {
                backwards += u64::from(wall.sign() * velocity <= 0.0);
                impacts += 1;
            }
        };
        let outcome = plant.advance_with(drive, s.step, see).expect("a valid step");
        let mut gone = 0.0;
        let mut pulls = f64::NEG_INFINITY;
        for (n, part) in LOOKS.iter().enumerate() {
            let drive = if n == 0 { drive } else { looked.base().drive };
            looked.advance(drive, part * s.step - gone).expect("a valid step");
            gone = part * s.step;
            let state = looked.state();
            let [plus, minus] = looked.parameters().gaps();
            let rounding = 1e-14 * (state.q1.abs().max(state.q2.abs()));
            let outside = ((state.q1 - state.q2 - plus).max(minus.mul_add(-1.0, state.q2 - state.q1)) - rounding)
                / (0.5 * (plus + minus));
            figures.largest("outside its cavity inside steps by, in half-widths", outside, 1e-11);
            if let Some(wall) = looked.contact()
                && s.parameters.cavity.kinetic_friction == 0.0
            {
                let acceleration = looked.point(looked.host().cavity_row())[2];
                let push = acceleration - looked.constant_accelerations().0;
                pulls = pulls.max(-wall.sign() * push / (acceleration.abs() + 1.0));
            }
        }
        let state = plant.state();
        let finite = [state.q1, state.dq1, state.q2, state.dq2].iter().all(|x| x.is_finite());
        let rate = fastest.max(drive.omega.abs());
        let events = impacts + outcome.stuck + outcome.released;
        let work = outcome.evaluations as f64 / (events as f64 + 1.0 + rate * s.step);
        record! { figures:
            "outside its cavity by, in half-widths" largest outside_by(&plant, 0.0), 1e-12;
            "walls that pull, relative to the acceleration" largest pulls, 1e-9;
            "states that are not numbers" count !finite, 0.0;
            "impacts" count impacts, ANY;
            "persistent contacts" count outcome.stuck, ANY;
            "impacts from behind a wall or not counted" count backwards + outcome.impacts.abs_diff(impacts), 0.0;
            "advances cut short before their 10^7 impacts or 2 10^6 releases"
                count outcome.cut_short && impacts < MOST_IMPACTS && outcome.released < MOST_RELEASES, 0.0;
            "impacts in a period, at most" largest impacts as f64 / (s.step * rate / TAU).max(1.0), ANY;
            "evaluations per event and radian of the fastest rate, at most" largest work, 50.0;
        }
        if s.amplitude == 0.0 {
            let (now, lost) = (plant.energy(), plant.totals().dissipated + plant.totals().friction);
            largest = largest.max(now.abs()).max(lost);
            if largest > 0.0 {
                figures.largest(
                    "energy grows without excitation by, relative",
                    (now - before) / largest,
                    1e-12,
                );
                if s.coupling == 0.0 && s.modes.iter().all(|mode| mode.zeta == 0.0) {
                    let missing = (now + lost - at_start).abs() / largest;
                    figures.largest("energy and dissipated energy miss, undamped, relative", missing, 1e-11);
                }
            }
            before = now;
        }
        if plant.totals().impacts + outcome.released >= IMPACTS_FOLLOWED {
            break;
        }
    }
    figures.count("sticks", plant.totals().sticks, ANY);
    plant
}

/// Follows a structure twice; the second time its state is saved and restored in a new plant before every step.
pub fn follow(scene: &Scene, figures: &mut Figures) {
    let mut scene = scene.clone();
    if scene.parameters.restitution == 1.0 {
        // Hops without loss never die out.
        scene.step = scene.step.min(1.0);
    }
    let (plant, other) = (
        once(&scene, false, figures),
        once(&scene, true, &mut Figures::default()),
    );
    let differs = format!("{:?}", plant.save()) != format!("{:?}", other.save());
    figures.count("runs with other bits from saved states", differs, 0.0);
}
