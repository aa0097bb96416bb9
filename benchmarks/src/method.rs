//! What every method can do, how it is timed, and the methods: this project's plant, stepped in several ways and through its C interface, and the
//! closed form with Brent's method.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use fmi2_boundary::{Fmu, Interface, Master};
use lovines::{Plant, State};
use serde::Serialize;

use crate::baseline::{self, Baseline};
use crate::scene::{Scene, Step};

/// How a method failed.
#[derive(Clone, Debug)]
pub struct Failure(pub String);

/// A way to follow a scene.
pub trait Method: Sized {
    /// At the scene's start. `setting` is a tolerance or a number of steps: what the method's accuracy hangs on.
    ///
    /// # Errors
    /// A scene that this method is not made for.
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure>;

    /// One step of the scene.
    ///
    /// # Errors
    /// A step that the method could not finish.
    fn step(&mut self, step: &Step) -> Result<(), Failure>;

    /// The state now.
    fn state(&self) -> State;

    /// Impacts so far, as this method counts them.
    fn impacts(&self) -> u64;

    /// Makes of the scene's steps those that this method takes.
    fn steps(steps: &[Step]) -> Vec<Step> {
        steps.to_vec()
    }
}

/// What came of a few runs of one method on one scene.
#[derive(Debug, Default, Serialize)]
pub struct Answer {
    /// Wall times of a run, ns, without the setting up: the median of each turn.
    pub ns: Vec<f64>,
    /// The same of the plant, which takes turns with this method.
    pub plant_ns: Vec<f64>,
    /// States after the steps that were asked for.
    pub states: Vec<[f64; 4]>,
    /// Impacts in the whole run.
    pub impacts: u64,
    /// How it failed, if it did.
    pub failure: Option<String>,
}

/// Runs the scene in turns with the plant for about `budget`, one turn at least; a run that lasts longer than `limit` is given up.
/// `checks` are the steps, counted from 1, after which the state is kept.
pub fn measure<M: Method>(scene: &Scene, setting: f64, checks: &[usize], budget: Duration, limit: Duration) -> Answer {
    let mut answer = Answer::default();
    let began = Instant::now();
    let mut plant = || run::<Stepped>(scene, 0.0, checks, limit, &mut Vec::new()).map(|(ns, _)| (ns, 1.0));
    let (mut ns, mut plant_ns) = (Vec::new(), Vec::new());
    let mut method = || {
        answer.states.clear();
        let (ns, impacts) = run::<M>(scene, setting, checks, limit, &mut answer.states)?;
        answer.impacts = impacts;
        Ok((ns, 1.0))
    };
    let mut failure = None;
    while failure.is_none() && (ns.is_empty() || began.elapsed() < budget) {
        match baseline::pair(ns.len(), &mut plant, &mut method) {
            Ok(pair) => {
                plant_ns.push(pair[0]);
                ns.push(pair[1]);
            }
            Err(Failure(how)) => failure = Some(how),
        }
    }
    Answer { ns, plant_ns, failure, ..answer }
}

/// Nanoseconds and impacts of a run; adds the states after the steps in `checks`, or the state at the end if there are none.
fn run<M: Method>(
    scene: &Scene,
    setting: f64,
    checks: &[usize],
    limit: Duration,
    states: &mut Vec<[f64; 4]>,
) -> Result<(f64, u64), Failure> {
    let steps = M::steps(&scene.steps);
    // The clock is asked now and then only: it costs as much as a step without impact.
    let asked_every = (steps.len() / 50).max(1);
    let mut stops: Vec<usize> = (1..=steps.len()).step_by(asked_every).chain([steps.len()]).collect();
    stops.extend(checks.iter().filter(|&&check| check < steps.len()));
    stops.sort_unstable();
    stops.dedup();
    let mut method = M::start(scene, setting)?;
    let mut done = 0;
    let began = Instant::now();
    for stop in stops {
        for step in &steps[done..stop] {
            method.step(step)?;
            std::hint::black_box(method.state());
        }
        if checks.contains(&stop) {
            states.push(method.state().into());
        }
        done = stop;
        if began.elapsed() > limit {
            let (part, limit) = (100.0 * done as f64 / steps.len() as f64, limit.as_secs_f64());
            return Err(Failure(format!("time limit: {part:.2} % done after {limit} s")));
        }
    }
    let ns = began.elapsed().as_nanos() as f64;
    if states.is_empty() {
        states.push(method.state().into());
    }
    Ok((ns, method.impacts()))
}

/// The plant at the start of a scene.
///
/// # Errors
/// A scene that it refuses.
pub fn begin(scene: &Scene) -> Result<Plant, Failure> {
    let refused = |error: lovines::InvalidValue| Failure(error.to_string());
    let mut plant = Plant::new(scene.parameters, scene.start).map_err(refused)?;
    if let Some(first) = scene.steps.first() {
        plant.begin(first.drive).map_err(refused)?;
    }
    Ok(plant)
}

/// The plant with its fast path or with the plain solver, which searches for every contact and keeps nothing between steps; each step of the
/// scene in this many parts, with v and the base displacement read after each; or equal steps joined into one.
pub struct Stepped<const FAST: bool = true, const PARTS: u32 = 1, const JOINED: bool = false>(Plant);

impl<const FAST: bool, const PARTS: u32, const JOINED: bool> Method for Stepped<FAST, PARTS, JOINED> {
    fn start(scene: &Scene, _setting: f64) -> Result<Self, Failure> {
        let mut plant = begin(scene)?;
        plant.set_fast_path(FAST);
        Ok(Self(plant))
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        for _ in 0..PARTS {
            let advanced = self.0.advance(step.drive, step.duration / f64::from(PARTS));
            advanced.map_err(|error| Failure(error.to_string()))?;
            if PARTS > 1 {
                std::hint::black_box((self.0.centre(), self.0.base_displacement()));
            }
        }
        Ok(())
    }

    fn state(&self) -> State {
        self.0.state()
    }

    fn impacts(&self) -> u64 {
        self.0.totals().impacts
    }

    fn steps(steps: &[Step]) -> Vec<Step> {
        // The length of a joined step is rounded once, and not at every addition.
        let joined = |run: &[Step]| Step { duration: run[0].duration * run.len() as f64, ..run[0] };
        let equal = |a: &Step, b: &Step| JOINED && a == b;
        steps.chunk_by(equal).map(joined).collect()
    }
}

/// The plant through its C interface, as an FMI master in C calls it: two inputs set, one step, the states read.
pub struct Shell {
    rig: Master,
    time: f64,
    state: State,
}

/// Value references of q1, der(q1), q2 and der(q2), and of omega and E.
const STATE: [u32; 4] = [9, 10, 11, 12];
const INPUTS: [u32; 2] = [8, 7];

impl Shell {
    fn set(&self, step: &Step) {
        let inputs = [step.drive.omega, step.drive.amplitude];
        self.rig.well(self.rig.set_reals(&INPUTS, &inputs));
    }
}

impl Method for Shell {
    fn start(scene: &Scene, _setting: f64) -> Result<Self, Failure> {
        static PLANT: OnceLock<Fmu> = OnceLock::new();
        let rig = Master::new(PLANT.get_or_init(Fmu::plant), Interface::CoSimulation);
        let p = &scene.parameters;
        let masses = [p.primary_mass, p.stiffness, p.damping, p.particle_mass];
        let all = masses.into_iter().chain([p.half_width, p.restitution]);
        let start: [f64; 4] = scene.start.into();
        for (vr, value) in (0..).zip(all).chain(STATE.into_iter().zip(start)) {
            rig.well(rig.set_real(vr, value));
        }
        let shell = Self { rig, time: 0.0, state: scene.start };
        if let Some(first) = scene.steps.first() {
            shell.set(first);
        }
        shell.rig.start();
        Ok(shell)
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        self.set(step);
        self.rig.well(self.rig.step(self.time, step.duration));
        self.time += step.duration;
        self.state = self.rig.reals(&STATE).into();
        Ok(())
    }

    fn state(&self) -> State {
        self.state
    }

    fn impacts(&self) -> u64 {
        u64::try_from(self.rig.impacts()).unwrap_or(0)
    }
}

/// Its setting is the tolerance of the root search, s.
impl Method for Baseline {
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure> {
        Ok(Self::new(scene.parameters, scene.start, setting))
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let ended = self.advance(step.drive, step.duration);
        ended.map_err(|_| {
            let (t, n) = (self.elapsed, self.impacts);
            Failure(format!("stalled in the step from t = {t:.3} on, after {n} impacts"))
        })
    }

    fn state(&self) -> State {
        self.state()
    }

    fn impacts(&self) -> u64 {
        self.impacts
    }
}
