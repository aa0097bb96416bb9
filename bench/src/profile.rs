//! What a scene asks of the plant, counted: steps in which nothing is met, impacts, time at rest on a wall.

use lovines::Event;
use serde_json::{Value, json};

use crate::methods::begin;
use crate::scene::Scene;

/// Counts of the plant's run through the scene.
///
/// # Errors
/// A scene that the plant refuses.
pub fn of(scene: &Scene) -> anyhow::Result<Value> {
    let mut plant = begin(scene).map_err(|failure| anyhow::anyhow!(failure.0))?;
    let (mut empty, mut at_rest, mut whole) = (0u64, 0.0, 0.0);
    for step in &scene.steps {
        // Since when, in this step, the particle has been on a wall.
        let mut since = plant.contact().map(|_| 0.0);
        let outcome = plant.advance_with(step.drive(), step.duration, |event| match event {
            Event::Stuck { t, .. } => since = Some(t),
            Event::Released { t, .. } => at_rest += t - since.take().unwrap_or(t),
            _ => {}
        });
        let outcome = outcome?;
        at_rest += since.map_or(0.0, |since| step.duration - since);
        whole += step.duration;
        empty += u64::from(outcome.impacts == 0);
    }
    Ok(json!({
        "steps": scene.steps.len(),
        "empty": empty,
        "impacts": plant.totals().impacts,
        "at_rest": at_rest / whole,
    }))
}
