//! The backbone tracked with the loop closed, level by level.

use crate::backbone::track;
use crate::comparison::{TrackedComparison, TrackedPoint};
use crate::identification::Regime;
use crate::report::figures::tracked as figure;
use crate::report::files::{ReportError, tracked_csv};
use crate::report::section::{Section, Subject};
use crate::rig::{BuiltIn, Simulated};

pub(super) fn make(subject: &Subject, done: &(dyn Fn(f64) + Sync)) -> Result<Section, ReportError> {
    let mut section = Section::new("The backbone, tracked with the loop closed");
    let scene = &subject.scene;
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let mut rig = Simulated::of(scene)?;
    let found = track(rig.as_mut(), &mut controller, scene, |at, of| {
        done(at as f64 / of.max(1) as f64);
    });
    let tracked = match found {
        Ok(found) if !found.points.is_empty() => TrackedComparison::of(&found, scene),
        Ok(_) => {
            section.found("Tracking gave no point.");
            return Ok(section);
        }
        Err(error) => {
            section.found(format!("Tracking gave no backbone: {error}."));
            return Ok(section);
        }
    };
    let symmetric = |one: &&TrackedPoint| one.point.regime_by_impacts == Some(Regime::Symmetric);
    let in_regime = tracked.points.iter().filter(symmetric).count();
    section.finding = format!(
        "Tracked with the loop closed, the backbone took {} points in {:.0} periods, {:.1} a point.",
        tracked.points.len(),
        tracked.periods,
        tracked.periods_per_point()
    );
    section.words(format!(
        "A decay is not a steady motion, so its points lie off the backbone. Here the loop holds the response at one level after \
         another until it has settled, and the amplitude of the drive follows. {} Of these points, {in_regime} are in the symmetric 1:1 regime.",
        section.finding
    ));
    section.figure(
        "tracked-backbone",
        "The backbone tracked with the loop closed, the exact curve and first-order theory.",
        figure::figure(&tracked).svg()?,
    );
    if let Some(worst) = tracked.worst() {
        section.budget(
            "tracked backbone against the exact one",
            format!("at most {:.1e} in σ and G", worst.at_equal_c),
            "Largest difference from the exact curve at the same C, over all settled points.",
        );
    }
    section.attach("tracked.csv", tracked_csv(&tracked)?);
    Ok(section)
}
