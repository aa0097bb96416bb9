//! What every method can do, and how it is timed.

use std::time::{Duration, Instant};

use serde::Serialize;

use crate::scene::{Scene, Step};
use crate::turns;

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

    /// q1, q1', q2, q2' now.
    fn state(&self) -> [f64; 4];

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

/// Runs the scene in turns with the plant `P` for about `budget`, one turn at least; a run that lasts longer than `limit` is given up.
/// `checks` are the steps, counted from 1, after which the state is kept.
pub fn measure<P: Method, M: Method>(
    scene: &Scene,
    setting: f64,
    checks: &[usize],
    budget: Duration,
    limit: Duration,
) -> Answer {
    let mut answer = Answer::default();
    let began = Instant::now();
    let mut plant = || run::<P>(scene, 0.0, checks, limit, &mut Vec::new()).map(|(ns, _)| (ns, 1.0));
    let (mut ns, mut plant_ns) = (Vec::new(), Vec::new());
    let mut method = || {
        answer.states.clear();
        let (ns, impacts) = run::<M>(scene, setting, checks, limit, &mut answer.states)?;
        answer.impacts = impacts;
        Ok((ns, 1.0))
    };
    let mut failure = None;
    while ns.is_empty() || began.elapsed() < budget {
        match turns::pair(ns.len(), &mut plant, &mut method) {
            Ok(pair) => {
                plant_ns.push(pair[0]);
                ns.push(pair[1]);
            }
            Err(Failure(how)) => {
                failure = Some(how);
                break;
            }
        }
    }
    Answer { ns, plant_ns, failure, ..answer }
}

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
            states.push(method.state());
        }
        done = stop;
        if began.elapsed() > limit {
            return Err(Failure(format!(
                "time limit: {:.2} % done after {} s",
                100.0 * done as f64 / steps.len() as f64,
                limit.as_secs_f64()
            )));
        }
    }
    let ns = began.elapsed().as_nanos() as f64;
    if states.is_empty() {
        states.push(method.state());
    }
    Ok((ns, method.impacts()))
}
