//! Random scenes.

use lovines::{Cavity, Drive, Parameters, Restitution, State};
use proptest::prelude::*;

pub fn decades(from: f64, to: f64) -> impl Strategy<Value = f64> + Clone {
    (from..to).prop_map(|x| 10f64.powf(x))
}

/// A rig, its start, and how it is driven and stepped.
#[derive(Clone, Debug)]
pub struct Scene {
    pub parameters: Parameters,
    pub start: State,
    pub drive: Drive,
    pub step: f64,
}

impl Scene {
    /// Moves the particle to a wall of the ideal cavity, at rest there.
    pub fn start_at(&mut self, plus: bool) {
        let b = self.parameters.half_width;
        self.start.q2 = self.start.q1 - if plus { b } else { -b };
        self.start.dq2 = self.start.dq1;
    }
}

/// Rigs from feather-light to equal masses; undamped, light, near-critical and over-critical damping; dead to lively; starts that include both
/// walls.
pub fn scene(driven: bool) -> impl Strategy<Value = Scene> {
    let near_critical =
        (decades(-16.0, -2.0), any::<bool>()).prop_map(|(d, above)| if above { 1.0 + d } else { 1.0 - d });
    let zeta = prop_oneof![3 => Just(0.0), 3 => decades(-12.0, 1.0), 1 => near_critical];
    let rig = (
        decades(-6.0, 0.0),
        zeta,
        prop_oneof![3 => 1e-3..0.98f64, 1 => Just(0.65)],
    );
    let w = prop_oneof![4 => -1.0..1.0f64, 1 => Just(1.0), 1 => Just(-1.0)];
    let start = (
        -2.0..2.0f64,
        -2.0..2.0f64,
        w,
        prop_oneof![3 => -2.0..2.0f64, 1 => Just(0.0)],
    );
    let amplitude = if driven { 1.0 } else { 0.0 };
    let omega = prop_oneof![3 => 0.0..3.0f64, 1 => Just(1.0), 1 => -2.0..0.0f64];
    let drive = (decades(-6.0, 1.0), omega, -1.0..1.0f64);
    (rig, start, drive, decades(-2.0, 2.0)).prop_map(move |(rig, start, drive, step)| {
        let ((epsilon, zeta, r), (q1, dq1, w, dw), (e, omega, held)) = (rig, start, drive);
        let parameters = Parameters {
            damping: 2.0 * zeta,
            ..Parameters::dimensionless(epsilon, 1.0, r)
        };
        let start = State { q1, dq1, q2: q1 - w, dq2: dq1 - dw };
        let signal = [amplitude * held, 0.0, 0.0, 0.0];
        Scene {
            parameters,
            start,
            drive: Drive { signal, ..Drive::harmonic(amplitude * e, omega) },
            step,
        }
    })
}

/// A scene whose walls have any loss: none, hardly any, nearly all.
fn with_any_loss(driven: bool) -> impl Strategy<Value = Scene> {
    let restitution = prop_oneof![
        8 => Just(None),
        1 => decades(-6.0, -2.0).prop_map(|x| Some(1.0 - x)),
        1 => Just(Some(1.0)),
        1 => decades(-3.0, 0.0).prop_map(Some),
    ];
    (scene(driven), restitution).prop_map(|(mut s, r)| {
        s.parameters.restitution = r.unwrap_or(s.parameters.restitution);
        s
    })
}

/// Free and driven motions, rest on a wall, gaps of 1e-6 to 1e3 amplitudes, signals of order 3.
pub fn hard() -> BoxedStrategy<Scene> {
    let at_rest = (with_any_loss(true), any::<bool>(), any::<bool>()).prop_map(|(mut s, plus, still)| {
        if still {
            s.drive = Drive::default();
            (s.start.q1, s.start.dq1) = (0.0, 0.0);
        }
        s.start_at(plus);
        s
    });
    let gaps = (with_any_loss(true), decades(-6.0, 3.0)).prop_map(|(mut s, gap)| {
        let w = s.start.q1 - s.start.q2;
        let amplitude = s.start.q1.abs().max(s.drive.amplitude);
        s.parameters.half_width = gap * amplitude;
        // A narrow gap is crossed a million times a period.
        s.step = s.step.min(1.0);
        s.start.q2 = s.start.q1 - w.clamp(-1.0, 1.0) * s.parameters.half_width;
        // The difference of two displacements carries their rounding.
        if (s.start.q1 - s.start.q2).abs() > s.parameters.half_width {
            s.start.q2 = s.start.q1;
        }
        s
    });
    let signals = (with_any_loss(true), prop::array::uniform3(-1.0..1.0f64)).prop_map(|(mut s, [u1, u2, u3])| {
        // Of the order of the half-width at the end of a step, or of the scene where that is long.
        let t = s.step.max(1.0);
        s.drive.signal[1..].copy_from_slice(&[u1 / t, u2 / (t * t), u3 / (t * t * t)]);
        s
    });
    let any = prop_oneof![6 => with_any_loss(false), 6 => with_any_loss(true), 3 => at_rest, 3 => gaps, 2 => signals];
    any.boxed()
}

/// Damped rigs, driven or not.
pub fn damped() -> BoxedStrategy<Scene> {
    let damping = decades(-3.0, 1.0).prop_map(|ratio| 2.0 * ratio);
    let drawn = (any::<bool>().prop_flat_map(scene), damping);
    let scenes = drawn.prop_map(|(mut s, damping)| {
        s.parameters.damping = damping;
        s
    });
    scenes.boxed()
}

/// A scene with any of the effects. Gravity is from negligible to overwhelming against the accelerations of the rig.
pub fn cavity() -> BoxedStrategy<Scene> {
    let law = || {
        prop_oneof![
            2 => Just(None),
            1 => (0.05..=1.0f64).prop_map(|r| Some(Restitution::Constant(r))),
            1 => decades(-3.0, 0.0).prop_map(|k| Some(Restitution::Viscoelastic(k))),
            1 => decades(-1.5, 0.5).prop_map(|v| Some(Restitution::Plastic(v))),
        ]
    };
    let friction = prop_oneof![
        2 => Just((0.0, None)),
        3 => decades(-4.0, 0.5).prop_map(|mu| (mu, None)),
        2 => (decades(-4.0, 0.5), 1.0..2.0f64).prop_map(|(mu, more)| (mu, Some(mu * more))),
    ];
    let upright = Just(core::f64::consts::FRAC_PI_2);
    let tilt = prop_oneof![2 => Just(0.0), 1 => upright, 2 => -1.5..1.5f64, 1 => decades(-9.0, 0.0)];
    let gap = || prop_oneof![1 => Just(None), 1 => (0.2..3.0f64).prop_map(Some)];
    let scatter = prop_oneof![2 => Just(0.0), 1 => decades(-3.0, 0.0)];
    let least = prop_oneof![2 => Just(0.0), 1 => 0.0..1.0f64];
    let walls = ((gap(), gap()), (law(), law()), scatter, least);
    let scene = any::<bool>().prop_flat_map(scene);
    let drawn = (
        scene,
        (friction, tilt, walls, any::<u64>()),
        decades(-1.0, 5.0),
        -1.0..1.0f64,
    );
    let scenes = drawn.prop_map(|(mut s, (friction, tilt, walls, seed), stiffness, place)| {
        let (gaps, laws, scatter, least_restitution) = walls;
        // The same motion in another time.
        let rate = f64::sqrt(stiffness);
        s.parameters.cavity = Cavity {
            b_plus: gaps.0,
            b_minus: gaps.1,
            tilt,
            kinetic_friction: friction.0,
            static_friction: friction.1,
            restitution: [laws.0, laws.1].map(|law| match law {
                // Below its yield speed a wall takes no energy: slow particles would hop on it for ever.
                Some(Restitution::Plastic(v)) => Some(Restitution::Plastic(v * rate)),
                law => law,
            }),
            least_restitution,
            scatter,
            seed,
        };
        s.parameters.stiffness = stiffness;
        s.parameters.damping *= rate;
        (s.start.dq1, s.start.dq2) = (s.start.dq1 * rate, s.start.dq2 * rate);
        s.drive.omega *= rate;
        s.step = s.step.min(10.0) / rate;
        let [plus, minus] = s.parameters.gaps();
        let w = match place {
            _ if place > 0.95 => plus,
            _ if place < -0.95 => -minus,
            _ => 0.5 * (plus - minus),
        };
        s.start.q2 = s.start.q1 - w;
        if s.drive.amplitude == 0.0 {
            // Undamped and undriven: the energy is to stay.
            (s.drive, s.parameters.damping) = (Drive::default(), 0.0);
        }
        s
    });
    scenes.boxed()
}
