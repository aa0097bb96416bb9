//! Kinds of random scenes, followed on all cores, and the table of what they show.

use proptest::strategy::{BoxedStrategy, Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use rayon::prelude::*;
use std::fmt::Debug;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// No limit: the figure is only printed.
pub const ANY: f64 = f64::INFINITY;
/// Scenes followed between two lines about the progress.
const PORTION: usize = 10_000;

/// Adds figures: the name, `count` or `largest` of the value, and the largest value that is allowed.
macro_rules! record {
    ($figures:ident: $($what:literal $kind:ident $value:expr, $allowed:expr;)*) => {$(
        $figures.$kind($what, $value, $allowed);
    )*};
}

/// A count over all scenes, or the largest value and the scene that shows it.
#[derive(Clone, Debug)]
struct Figure {
    what: &'static str,
    value: f64,
    allowed: f64,
    scene: Option<usize>,
}

/// Figures by name.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    all: Vec<Figure>,
    /// Rows that exceed their limits.
    exceeded: Vec<String>,
}

impl Figures {
    fn add(&mut self, new: Figure) {
        let Some(old) = self.all.iter_mut().find(|old| old.what == new.what) else {
            return self.all.push(new);
        };
        if new.scene.is_none() {
            old.value += new.value;
        } else if new.value > old.value || new.value.is_nan() {
            *old = new;
        }
    }

    /// Adds to a count.
    pub fn count(&mut self, what: &'static str, n: impl Into<u64>, allowed: f64) {
        self.add(Figure { what, value: n.into() as f64, allowed, scene: None });
    }

    /// Keeps the largest value.
    pub fn largest(&mut self, what: &'static str, value: f64, allowed: f64) {
        self.add(Figure { what, value, allowed, scene: Some(0) });
    }

    /// Prints the figures that were gathered, and notes those that exceed their limits.
    pub fn print(&mut self, kind: &str, scenes: usize) {
        for Figure { what, value, allowed, scene } in std::mem::take(&mut self.all) {
            let [short, limit] = [value, allowed].map(|x| match x {
                _ if x.is_infinite() => "any".to_owned(),
                _ if x == 0.0 || (1.0..1e7).contains(&x) => format!("{x:.0}"),
                _ => format!("{x:.1e}"),
            });
            let worst = scene.filter(|_| scenes > 1 && value > 0.0);
            let worst = worst.map_or(String::new(), |number| format!("; worst: {number}"));
            println!("| {kind}: {what} | {scenes} scenes{worst} | {short} | {limit} |");
            if value > allowed || value.is_nan() {
                let row = format!("{kind}: {what}: {value:e} is above {allowed:e}");
                self.exceeded.push(row);
            }
        }
    }

    /// Asserts that all rows have kept their limits.
    pub fn end(self) {
        assert!(self.exceeded.is_empty(), "{:#?}", self.exceeded);
    }

    /// Follows `n` scenes of a kind and prints a row for each figure; where the environment names a scene, that one alone. `SKIP` is the number of
    /// scenes that another run has followed.
    pub fn run<T: Debug>(
        &mut self,
        kind: &str,
        n: usize,
        strategy: fn() -> BoxedStrategy<T>,
        follow: fn(&T, &mut Self),
    ) {
        if let Ok(name) = std::env::var("SCENE") {
            let (wanted, number) = name.split_once(':').expect("a kind of scenes, a colon and a number");
            if wanted == kind {
                let scene = draw(&strategy(), number.parse().expect("a number"));
                println!("{scene:#?}");
                follow(&scene, self);
                self.print(kind, 1);
            }
            return;
        }
        let skipped = std::env::var("SKIP").map_or(0, |n| n.parse().expect("a number of scenes"));
        for begin in (skipped..n).step_by(PORTION) {
            let end = n.min(begin + PORTION);
            let one = |strategy: &mut BoxedStrategy<T>, number| {
                let (scene, mut figures) = (draw(strategy, number), Self::default());
                let panics = catch_unwind(AssertUnwindSafe(|| follow(&scene, &mut figures))).is_err();
                if panics {
                    eprintln!("{kind} scene {number} panics: {scene:?}");
                }
                figures.count("panics", panics, 0.0);
                for figure in &mut figures.all {
                    figure.scene = figure.scene.map(|_| number);
                }
                figures
            };
            let scenes: Vec<Self> = (begin..end).into_par_iter().map_init(strategy, one).collect();
            let all = scenes.into_iter().flat_map(|scene| scene.all);
            all.for_each(|figure| self.add(figure));
            if n > PORTION {
                eprintln!("{kind}: {end} of {n} scenes");
            }
        }
        self.print(kind, n - skipped.min(n));
    }
}

/// Scene `number` of what a strategy draws.
fn draw<T: Debug>(strategy: &BoxedStrategy<T>, number: usize) -> T {
    let mut seed = [7; 32];
    seed[..8].copy_from_slice(&(number as u64).to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    strategy.new_tree(&mut runner).expect("a scene").current()
}
