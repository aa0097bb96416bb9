//! A continued curve: its limits, its motions, and where its stability changes.

use serde::{Serialize, Serializer, ser::SerializeStruct};

use super::{bounce::Bounce, condition::Bifurcation, periodic::Periodic};

/// Limits of a continuation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Range of sigma.
    pub sigma: [f64; 2],
    /// Range of G.
    pub g: [f64; 2],
    /// Most points.
    pub points: usize,
    /// Longest step in the space of the unknowns.
    pub step: f64,
}

impl Default for Limits {
    /// Detunings from -6 to 6, G up to 10, 2000 points at most 0.05 apart.
    fn default() -> Self {
        Self {
            sigma: [-6.0, 6.0],
            g: [-1e-6, 10.0],
            points: 2000,
            step: 0.05,
        }
    }
}

/// Why a branch ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Ended {
    /// It left the range of sigma or G.
    #[serde(rename = "left the range")]
    Range,
    /// It came back to its start.
    #[serde(rename = "closed")]
    Closed,
    /// The largest number of points was reached.
    #[serde(rename = "number of points")]
    Points,
    /// Its motions, which are not 1:1, are unstable for a hundred points from there on: such a branch winds on within chaos.
    #[serde(rename = "unstable from there on")]
    Unstable,
    /// It joins the branch whose symmetry it breaks or whose period it doubles; beyond that it is its own mirror image.
    #[serde(rename = "joins a shorter pattern")]
    Joins,
    /// The complex pair of multipliers on the unit circle becomes real.
    #[serde(rename = "strong resonance")]
    Resonance,
    /// The pattern of impacts ends here: a graze, or impacts that accumulate.
    #[serde(rename = "graze")]
    Graze,
}

/// A point where stability changes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Special {
    /// What happens.
    pub kind: Bifurcation,
    /// The motion is stable on one side.
    pub of_stable: bool,
    /// The motion there.
    pub motion: Periodic,
}

/// A continued curve. It is serialised with its pattern once, and with the points that a drawing needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// Its motions in order.
    pub points: Vec<Periodic>,
    /// Where stability changes, in order.
    pub special: Vec<Special>,
    /// Why it ended, before its first and after its last motion.
    pub ended: [Ended; 2],
}

/// Points without a stable motion after which a branch that is not 1:1 ends.
const UNSTABLE: usize = 100;
/// Largest distance of a motion of a branch from the lines between those that are serialised, in sigma, G, B and both parts of C.
const DRAWN: f64 = 1e-4;

/// A motion of a branch as it is serialised; the impacts follow from the first one.
#[derive(Serialize)]
struct Point<'a> {
    #[serde(rename = "G")]
    g: f64,
    sigma: f64,
    #[serde(rename = "C")]
    c: f64,
    gamma: f64,
    #[serde(rename = "B")]
    b: f64,
    multipliers: [[f64; 2]; 4],
    stable: bool,
    start: &'a Bounce,
}

impl<'a> From<&'a Periodic> for Point<'a> {
    fn from(motion: &'a Periodic) -> Self {
        let Periodic { g, sigma, c, gamma, b, multipliers, stable, ref bounces, .. } = *motion;
        Self {
            g,
            sigma,
            c,
            gamma,
            b,
            multipliers,
            stable,
            start: &bounces[0],
        }
    }
}

impl Serialize for Branch {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let points: Vec<Point> = self.drawn().into_iter().map(Point::from).collect();
        let mut fields = serializer.serialize_struct("Branch", 4)?;
        fields.serialize_field("shape", &self.points[0].pattern)?;
        fields.serialize_field("points", &points)?;
        fields.serialize_field("special", &self.special)?;
        fields.serialize_field("ended", &self.ended)?;
        fields.end()
    }
}

impl Branch {
    /// The motions that a drawing needs: the ends, both sides of a change of stability, and those without which a line is too far off.
    pub fn drawn(&self) -> Vec<&Periodic> {
        let points = &self.points;
        let (mut drawn, mut from) = (vec![&points[0]], 0);
        for to in 1..points.len() {
            let changes = |n: usize| points[n].stable != points[n - 1].stable;
            let passed = from + 1..to;
            let ends = changes(to) || to > 1 && changes(to - 1);
            if !passed.is_empty()
                && (ends
                    || passed
                        .into_iter()
                        .any(|n| off(&points[n], [&points[from], &points[to]]) > DRAWN))
            {
                from = to - 1;
                drawn.push(&points[from]);
            }
        }
        drawn.extend(points[1..].last());
        drawn
    }

    /// Its motions are not 1:1, and the last ones are unstable.
    pub(super) fn winds(&self) -> bool {
        let last = self.points.len().checked_sub(UNSTABLE).map(|from| &self.points[from..]);
        !self.points[0].pattern.is_one_to_one() && last.is_some_and(|last| last.iter().all(|one| !one.stable))
    }
}

/// Distance of a motion from the line between two others.
fn off(motion: &Periodic, [from, to]: [&Periodic; 2]) -> f64 {
    let (chord, beside) = (
        to.invariants() - from.invariants(),
        motion.invariants() - from.invariants(),
    );
    let part = (beside.dot(&chord) / chord.norm_squared()).clamp(0.0, 1.0);
    (beside - chord * part).norm()
}

impl Ended {
    /// As in a table.
    pub fn name(&self) -> &'static str {
        match self {
            Ended::Range => "left the range",
            Ended::Closed => "closed",
            Ended::Points => "number of points",
            Ended::Unstable => "unstable from there on",
            Ended::Joins => "joins a shorter pattern",
            Ended::Resonance => "strong resonance",
            Ended::Graze => "graze",
        }
    }
}

impl Special {
    /// As in a table. A modulation begins at a torus bifurcation only if the motion was stable before.
    pub fn name(&self) -> &'static str {
        match (self.kind, self.of_stable) {
            (Bifurcation::Torus, true) => "torus (modulation begins)",
            (Bifurcation::Torus, false) => "Neimark-Sacker of an unstable motion",
            (kind, _) => kind.name(),
        }
    }
}

impl Limits {
    /// Whether a motion lies in the ranges.
    pub(super) fn contain(&self, sigma: f64, g: f64) -> bool {
        let inside = |value: f64, [low, high]: [f64; 2]| (low..=high).contains(&value);
        inside(sigma, self.sigma) && inside(g, self.g)
    }
}
