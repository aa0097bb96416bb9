//! What the studies share: scenes, random numbers, statistics, and the tables in validation/.

#![allow(dead_code, reason = "no study uses everything")]

use std::{fs, path::Path};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use vines_testbench::scene::{Override, Scene};

/// Any error of a study.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The arguments of the program.
pub fn arguments() -> Vec<String> {
    std::env::args().skip(1).collect()
}

/// A scene with replaced values; an empty text is the default scene.
pub fn scene(text: &str, settings: &[impl AsRef<str>]) -> Result<Scene, Failure> {
    let overrides = settings.iter().map(|one| one.as_ref().parse());
    let overrides = overrides.collect::<Result<Vec<Override>, _>>()?;
    if text.is_empty() {
        return Ok(Scene::load(None, &overrides)?);
    }
    Ok(Scene::parse("scene of a study", text, &overrides)?)
}

/// Random numbers between two limits.
pub fn uniform(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move |low, high| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64)
}

/// The value below which this share of the values lies; NaN of none.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let at = (share * last as f64).round() as usize;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}

/// Share of the values up to a limit.
pub fn share(values: &[f64], limit: f64) -> f64 {
    values.iter().filter(|value| **value <= limit).count() as f64 / values.len() as f64
}

/// What was measured on one random rig.
#[derive(Default)]
pub struct Found {
    /// Errors.
    pub errors: Vec<f64>,
    /// Errors over their standard uncertainties u.
    pub ratios: Vec<f64>,
    /// Periods that it took, if it succeeded.
    pub periods: Option<f64>,
    /// What else is counted.
    pub counts: [usize; 4],
}

/// The columns of [`statistics`].
pub const STATISTICS: &str = "within_1.96u,within_2u,worst_u,median_error,worst_error,median_periods,worst_periods";

/// Statistics of all rigs, and the sums of their counts.
pub fn statistics(found: &[Found]) -> (String, [usize; 4]) {
    let gather = |values: fn(&Found) -> &[f64]| found.iter().flat_map(|one| values(one).to_vec()).collect::<Vec<f64>>();
    let (ratios, errors) = (gather(|one| &one.ratios), gather(|one| &one.errors));
    let periods = gather(|one| one.periods.as_slice());
    let ends = |values: &[f64]| [quantile(values, 0.5), quantile(values, 1.0)];
    let ([error, worst], [median, longest]) = (ends(&errors), ends(&periods));
    let ([within, within_2], most) = ([1.96, 2.0].map(|limit| share(&ratios, limit)), quantile(&ratios, 1.0));
    let text = format!("{within:.4},{within_2:.4},{most:.1},{error:.1e},{worst:.1e},{median:.1},{longest:.1}");
    (text, [0, 1, 2, 3].map(|n| found.iter().map(|one| one.counts[n]).sum()))
}

/// Adds rows to validation/`name`.csv; a row replaces the one that begins with the same `key` cells.
pub fn write(name: &str, header: &str, key: usize, rows: &[String]) -> Result<(), Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../validation");
    let path = folder.join(format!("{name}.csv"));
    let text = fs::read_to_string(&path).unwrap_or_default();
    let begins_alike = |one: &str, other: &str| one.split(',').take(key).eq(other.split(',').take(key));
    let is_kept = |line: &&str| !rows.iter().any(|row| begins_alike(row, line));
    let kept = text.lines().skip(1).filter(is_kept).map(String::from);
    let lines: Vec<String> = [header.into()]
        .into_iter()
        .chain(kept)
        .chain(rows.iter().cloned())
        .collect();
    println!("{header}\n{}", rows.join("\n"));
    Ok(fs::write(path, lines.join("\n") + "\n")?)
}
