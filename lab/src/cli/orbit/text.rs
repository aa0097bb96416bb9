//! Orbits and their curves as text.

use std::fmt::Write;

use vines::orbit::{Branch, Ended, Orbit, Periodic};
use vines::report::{Table, number, summary::parameters};
use vines::{numerics::range, scene::Dimensionless};

use crate::cli::failure::Failure;
use crate::cli::output::{output, yes_no};

/// What was found as JSON, or as text under a title and the parameters of the scene.
pub(super) fn shown(
    scene: &Dimensionless,
    title: &str,
    found: &impl serde::Serialize,
    json: bool,
    text: impl FnOnce() -> String,
) -> Result<String, Failure> {
    output(json, found, || {
        format!("{title}\n  {}\n\n{}", parameters(scene), text())
    })
}

/// What `--response` searches for.
pub(super) const SEARCHED: &str = "Complete: symmetric 1:1 motions and what branches off them. Isolated branches of other patterns are missed; \
    --sigma follows the\none that a start leads to.\n";

/// The motion and the states after its impacts.
pub(super) fn described(pattern: &str, motion: &Periodic) -> String {
    let Periodic { sigma, c, b, gamma, .. } = motion;
    let multipliers = motion.multipliers.map(|[re, im]| format!("{re:.5}{im:+.5}i"));
    let rows = motion.bounces.iter().map(|one| {
        let phase = one.phase.to_degrees().rem_euclid(360.0);
        let mut cells = vec![format!("{:+}", one.wall)];
        cells.extend([phase, one.q1, one.dq1, one.dq2].map(number));
        cells
    });
    let table = Table::new("wall | phase, degrees | q1 | q1' after | q2' after").rows(rows);
    format!(
        "{pattern}\n  sigma = {sigma:.6}, C = {c:.6}, phase {:.4} degrees, B = {b:.6}\n  multipliers {}\n\n{}",
        gamma.to_degrees(),
        multipliers.join(", "),
        table.text()
    )
}

/// Rows of a curve in a text table.
const ROWS: usize = 24;

/// A curve: its ends, some of its orbits, its bifurcations.
pub(super) fn curve(name: &str, branch: &Branch) -> String {
    let stable = branch.points.iter().filter(|one| one.stable).count();
    let sigmas = || branch.points.iter().map(|one| one.sigma);
    let (low, high) = range((f64::MAX, f64::MIN), sigmas());
    let ends = match branch.ended {
        [Ended::Closed, _] => "closed".into(),
        [one, other] => format!("ends: {}; {}", one.name(), other.name()),
    };
    let mut text = format!(
        "{name}: sigma from {low:.4} to {high:.4}, {} orbits, {stable} of them stable; {ends}\n",
        branch.points.len()
    );
    let row = |motion: &Periodic| -> Vec<String> {
        let largest = motion.moduli()[3];
        let numbers = [motion.sigma, motion.g, motion.c, motion.gamma.to_degrees(), motion.b];
        let mut cells: Vec<String> = numbers.map(number).into();
        cells.extend([number(largest), yes_no(motion.stable)]);
        cells
    };
    let table = Table::new("sigma | G | C | phase, degrees | B | largest mult. | stable");
    let thinned = branch.points.iter().step_by(branch.points.len().div_ceil(ROWS));
    text += &table.rows(thinned.map(row)).text();
    for special in &branch.special {
        let what = special.name();
        let Periodic { sigma, g, c, b, .. } = special.motion;
        let _ = writeln!(
            text,
            "  {what} at sigma = {sigma:.6}, G = {g:.6}, C = {c:.6}, B = {b:.6}"
        );
    }
    text + "\n"
}

/// Orbits, a line each.
pub(super) fn listing(scene: &Dimensionless, orbits: &[Orbit]) -> String {
    if orbits.is_empty() {
        return if scene.g == 0.0 {
            "  none: without excitation (G = 0) there is no resonance\n".into()
        } else {
            "  none between 0.2 and 3 omega0 at this excitation\n".into()
        };
    }
    let rows = orbits.iter().map(|orbit| {
        let numbers = [orbit.sigma, orbit.omega, orbit.c, orbit.gamma.to_degrees(), orbit.b];
        let mut row: Vec<String> = numbers.map(number).into();
        row.extend(orbit.multipliers.map(|one| format!("{one:.4}")));
        row.push(yes_no(orbit.stable));
        row
    });
    Table::new("sigma | Omega | C | phase, degrees | B | mult1 | mult2 | mult3 | mult4 | stable")
        .rows(rows)
        .text()
}
