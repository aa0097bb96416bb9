//! The regime map.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::map::LIMIT;
use crate::regime::Regime;
use crate::report::figures::regimes;
use crate::report::files::{ReportError, bifurcations_csv, map_csv};
use crate::report::section::{Section, Subject};
use crate::report::summary;
use crate::sweep::{Axis, Map};

pub(super) fn make(subject: &Subject, done: &(dyn Fn(f64) + Sync)) -> Result<Section, ReportError> {
    let mut section = Section::new("Regimes of the driven response");
    let [x, y] = &subject.map;
    let map = Map::new(subject.family.clone(), x, y, None, LIMIT)?;
    let (count, all) = (AtomicUsize::new(0), map.sweep.cells());
    let map = map.run(0, || {
        let n = count.fetch_add(1, Ordering::Relaxed) + 1;
        done(n as f64 / all as f64);
    })?;
    describe(&mut section, &map, subject);
    section.figure(
        "regimes",
        "The regime map. The black line is the border of the island in which first-order theory has a stable symmetric 1:1 motion. The \
         coloured curves are exact bifurcations of the 1:1 motions, solid where they bound the stability of one.",
        regimes::svg(&map)?,
    );
    section.budget(
        "regime map",
        "one start per cell".into(),
        "Where several regimes are stable, the start decides. Chaos that ends only after more periods than were simulated counts \
         as lasting; docs/regimes.md says how often that happens.",
    );
    section.attach("regimes.csv", map_csv(&map)?);
    section.attach("bifurcations.csv", bifurcations_csv(&map)?);
    Ok(section)
}

fn describe(section: &mut Section, map: &Map, subject: &Subject) {
    let [x, y] = subject.map.each_ref().map(Axis::short_form);
    let all = map.cells.len();
    let inside = map.cells.iter().filter(|one| one.theory_stable).count();
    let (_, agree) = map.count(Regime::Symmetric);
    let percent = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
    section.finding = format!(
        "Of {all} cells of the map, {inside} lie where the theory has a stable symmetric 1:1 motion; {:.0} % of these show it.",
        percent(agree, inside)
    );
    section.words(format!(
        "Each cell of the map over {} and {} is one plant, driven from the scene's start at a fixed frequency until it repeats itself, \
         at most for {} periods. A motion that has not repeated itself by then is chaotic if its largest Lyapunov exponent exceeds zero by \
         four standard errors, modulated if also a fifth of its impacts or more are captured into 1:1 resonance for a while, \
         quasi-periodic if the exponent is zero within its uncertainty, and otherwise undecided.",
        x, y, LIMIT
    ));
    section.table("How often each regime occurs.", summary::regimes(map));
    section.words(section.finding.clone());
}
