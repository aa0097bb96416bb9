//! Damaged scenes: an error, or a scene, and never a panic.

use std::path::Path;
use std::time::{Duration, Instant};

use fastrand::Rng;
use vines_scene::scene::Scene;

/// Values that nobody expects in the place of a number.
const WILD: [&str; 14] = [
    "0",
    "-0.0",
    "-1",
    "1e-320",
    "1e300",
    "-1e300",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "true",
    "\"\"",
    "[]",
    "99999999999999999999",
];

fn scenes() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut paths: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths
        .iter()
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect()
}

/// The text with one line or number changed.
fn damage(text: &str, random: &mut Rng) -> String {
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    let (at, to) = (random.usize(..lines.len()), random.usize(..lines.len()));
    match random.usize(..6) {
        0 => drop(lines.remove(at)),
        1 => lines.swap(at, to),
        2 => lines.insert(to, lines[at].clone()),
        3 => {
            let end = lines[at].floor_char_boundary(random.usize(..=lines[at].len()));
            lines[at].truncate(end);
        }
        _ => {
            let line = &lines[at];
            let is_part = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
            let starts: Vec<usize> = line
                .char_indices()
                .filter(|(_, c)| c.is_ascii_digit())
                .map(|(n, _)| n)
                .collect();
            if let Some(start) = random.choice(&starts).copied() {
                let end = line[start..].find(|c| !is_part(c)).map_or(line.len(), |n| start + n);
                lines[at] = format!("{}{}{}", &line[..start], random.choice(WILD).unwrap(), &line[end..]);
            }
        }
    }
    lines.join("\n") + "\n"
}

#[test]
fn a_damaged_scene_is_an_error_or_a_scene_and_never_a_panic() {
    let most = std::env::var("DAMAGED_SCENES").map_or(200, |text| text.parse().expect("a number of scenes"));
    let seed = std::env::var("SEED").map_or(1, |text| text.parse().expect("a seed"));
    let scenes = scenes();
    let mut random = Rng::with_seed(seed);
    let (mut counts, mut longest) = ([0_u64; 2], Duration::ZERO);
    for n in 0..most {
        let mut text = random.choice(&scenes).unwrap().clone();
        for _ in 0..random.usize(1..4) {
            text = damage(&text, &mut random);
        }
        let begin = Instant::now();
        let read = std::panic::catch_unwind(|| Scene::parse("damaged", &text, &[]).is_ok());
        counts[usize::from(read.unwrap_or_else(|_| panic!("scene {n} of seed {seed}:\n{text}")))] += 1;
        longest = longest.max(begin.elapsed());
    }
    println!(
        "{} damaged scenes are refused, {} are read; the longest takes {:.0} ms",
        counts[0],
        counts[1],
        longest.as_secs_f64() * 1e3
    );
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}
