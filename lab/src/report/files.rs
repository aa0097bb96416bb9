//! The files of a run: tables, figures and JSON.

use serde::Serialize;
use serde_json::Value;
use thiserror::Error;

use super::figures::{backbone, history, manifold, regimes, tracked};
use crate::comparison::{Comparison, TrackedComparison, TrackedPoint};
use crate::linear::MeasuredLinear;
use crate::orbit::Periodic;
use crate::record::Record;
use crate::regime::Regime;
use crate::regime_map::{Map, MapCell};
use crate::scene::Scene;

/// Why the files of a run could not be written.
#[derive(Debug, Error)]
pub enum ReportError {
    #[error("cannot write a table as CSV: {0}")]
    Csv(#[from] csv::Error),
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Name and content of a file.
pub type ResultFile = (&'static str, String);

/// `identification.json`, `backbone.csv`, `backbone.svg`, `history.svg` and `sim.svg`.
pub fn identification_files(
    result: &Comparison,
    record: &Record,
    scene: &Scene,
) -> Result<Vec<ResultFile>, ReportError> {
    Ok(vec![
        ("identification.json", json(result)?),
        ("backbone.csv", decay_csv(result)?),
        ("backbone.svg", backbone(result).svg()),
        ("history.svg", history(record, scene, result).svg()),
        ("sim.svg", manifold(result).svg()),
    ])
}

/// `map.csv`, `map.svg` and, over sigma and G, `bifurcations.csv`.
pub fn map_files(map: &Map) -> Result<Vec<ResultFile>, ReportError> {
    let mut files = vec![("map.csv", map_csv(map)?)];
    if !map.curves.is_empty() {
        files.push(("bifurcations.csv", bifurcations_csv(map)?));
    }
    files.push(("map.svg", regimes(map).svg()));
    Ok(files)
}

/// `tracked.json`, `tracked.csv` and `tracked.svg`.
pub fn tracked_files(result: &TrackedComparison) -> Result<Vec<ResultFile>, ReportError> {
    Ok(vec![
        ("tracked.json", json(result)?),
        ("tracked.csv", tracked_csv(result)?),
        ("tracked.svg", tracked(result).svg()),
    ])
}

fn json(result: &impl Serialize) -> Result<String, ReportError> {
    Ok(serde_json::to_string_pretty(result)? + "\n")
}

/// A CSV table with a line per row. The headings are the names of the fields; tuples have none, and need `headings`, separated by commas.
fn csv<T: Serialize>(headings: &str, rows: impl IntoIterator<Item = T>) -> Result<String, ReportError> {
    let own = headings.is_empty();
    let mut writer = csv::WriterBuilder::new().has_headers(own).from_writer(Vec::new());
    if !own {
        writer.write_record(headings.split(','))?;
    }
    for row in rows {
        writer.serialize(row)?;
    }
    let bytes = writer.into_inner().map_err(|error| error.into_error());
    let bytes = bytes.map_err(csv::Error::from)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The points along a decay, as CSV: the columns are the keys of their JSON.
fn decay_csv(result: &Comparison) -> Result<String, ReportError> {
    let points = serde_json::to_value(&result.decay)?;
    let points: Vec<_> = points
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_object)
        .collect();
    let headings: Vec<&str> = points
        .first()
        .into_iter()
        .flat_map(|point| point.keys())
        .map(String::as_str)
        .collect();
    let rows = points.iter().map(|point| point.values().collect::<Vec<_>>());
    csv(&headings.join(","), rows)
}

/// The points of a tracked backbone.
fn tracked_csv(result: &TrackedComparison) -> Result<String, ReportError> {
    let headings = "f_Hz,A_m,E_m,u_f_Hz,u_A_m,u_E_m,sigma,C,G,phase_target_deg,phase_error_deg,u_sigma,u_C,u_G,u_phase_deg,level,periods,averaged,settled,\
                    reached,motion,regime_by_impacts,tone_Hz,tone_share,distance,sigma_less_exact,G_less_exact";
    let is_forced = result.points.iter().any(|compared| compared.point.at.f_n.is_some());
    let headings = match is_forced {
        true => headings.replace("E_m,", "F_N,"),
        false => headings.into(),
    };
    let mut headings = format!("{headings},{}", MeasuredLinear::COLUMNS.join(","));
    let is_shaken = result.points.iter().any(|compared| compared.point.command_v.is_some());
    if is_shaken {
        headings += &(2..8).map(|n| format!(",drive_{n}")).collect::<String>();
        headings += ",clipped_percent,command_V";
    }
    let numbers = |one: MeasuredLinear| [one.f0, one.u_f0, one.zeta, one.u_zeta, one.correlation];
    let linear = result.linear.map_or([None; 5], |one| numbers(one).map(Some));
    let particle = result.linear.map(|one| one.particle);
    let rows = result.points.iter().map(|TrackedPoint { point, exact }| {
        let motion = (point.level, point.periods, point.averaged, point.settled, point.reached);
        let tone = point.tone.map(|tone| (tone.hertz, tone.share)).unzip();
        let exact = exact.map_or((None, None, None), |exact| (Some(exact.nearest), exact.sigma, exact.g));
        let regime = (point.regime.motion(), point.regime_by_impacts);
        let harmonics = point.drive_harmonics.map(|values| values.map(Some)).unwrap_or_default();
        let clipped = [point.clipped_percent, point.command_v];
        let of_shaker = harmonics.into_iter().chain(clipped).filter(|_| is_shaken);
        (
            point.at,
            motion,
            regime,
            tone,
            exact,
            linear,
            particle,
            of_shaker.collect::<Vec<_>>(),
        )
    });
    csv(&headings, rows)
}

/// The cells of a map, as CSV.
fn map_csv(map: &Map) -> Result<String, ReportError> {
    const HEADINGS: &str = "sigma,G,r,regime,followed,transient,recurrence,exponent,exponent_error,synchrony,impacts_per_period,impacts,\
                            periods,sticks_per_period,theory_stable,coexisting";
    // Axes that are not among the first three columns come before them.
    let own: Vec<usize> = (0..2)
        .filter(|n| HEADINGS.split(',').all(|heading| heading != map.names()[*n]))
        .collect();
    let headings: Vec<&str> = own.iter().map(|n| map.names()[*n]).chain([HEADINGS]).collect();
    let row = |(n, cell): (u64, &MapCell)| {
        let MapCell { sigma, g, r, result, theory_stable, .. } = *cell;
        let place = [map.x.at(n % map.x.points), map.y.at(n / map.x.points)];
        let place: Vec<f64> = own.iter().map(|n| place[*n]).collect();
        let coexisting: Vec<&str> = cell.coexisting.iter().map(Regime::name).collect();
        (place, [sigma, g, r], result, theory_stable, coexisting.join("; "))
    };
    csv(&headings.join(","), (0..).zip(&map.cells).map(row))
}

/// The points of the bifurcation curves.
fn bifurcations_csv(map: &Map) -> Result<String, ReportError> {
    let headings = "curve,bifurcation,sigma,G,C,B,bounds_stability";
    let rows = map.curves.iter().enumerate().flat_map(|(n, curve)| {
        curve.branch.points.iter().map(move |motion| {
            let Periodic { sigma, g, c, b, .. } = *motion;
            (n + 1, curve.name(), sigma, g, c, b, motion.bounds_stability())
        })
    });
    csv(headings, rows)
}
