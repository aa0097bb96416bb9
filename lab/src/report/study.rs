//! The whole report: computes the missing sections, and writes the page and the files.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::dark;
use super::files::ReportError;
use super::page::page;
use super::section::{Block, Section, Subject};
use super::sections::SECTIONS;
use crate::files;
use crate::sweep::Axis;

/// Folder of cached sections, inside the folder of the report.
const KEPT: &str = ".vines";

/// The finished report.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Files written; the page is the first.
    pub written: Vec<PathBuf>,
    /// Sections reused from an earlier run.
    pub kept: Vec<&'static str>,
    /// The findings, one sentence per section.
    pub findings: Vec<String>,
}

/// Writes the report on `subject` into `out`: `report.html`, each figure for light and dark backgrounds, and tables. Sections
/// of an earlier run are reused unless scene, version or axes have changed, or `fresh` is set. `progress` gets the name of the section being
/// made, and the fraction of all sections that is done, from 0 to 1.
pub fn write_report(
    subject: &Subject,
    out: &Path,
    fresh: bool,
    work_precision: Option<&str>,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Report, ReportError> {
    let (mut sections, mut kept) = (Vec::new(), Vec::new());
    for (n, (name, make)) in SECTIONS.into_iter().enumerate() {
        let key = key(subject, name);
        let at = |part: f64| progress(name, (n as f64 + part) / SECTIONS.len() as f64);
        at(0.0);
        let file = format!("{name}.json");
        if let Some(section) = found(&out.join(KEPT).join(&file), &key).filter(|_| !fresh) {
            kept.push(name);
            sections.push(section);
            continue;
        }
        let section = make(subject, &at)?;
        let text = serde_json::to_string(&section)?;
        let hash = hash(&format!(
            "{key}
{text}"
        ));
        // A section that cannot be kept is still part of this report.
        if let Err(error) = files::write(
            &out.join(KEPT),
            [(
                file,
                format!(
                    "{hash}
{text}"
                ),
            )],
        ) {
            log::warn!("{error}");
        }
        sections.push(section);
    }
    let mut files = vec![(
        "report.html".to_string(),
        page(&subject.scene, &sections, work_precision),
    )];
    for section in &sections {
        for block in &section.blocks {
            if let Block::Figure { name, svg, .. } = block {
                files.push((format!("{name}.svg"), svg.clone()));
                files.push((format!("{name}-dark.svg"), dark(svg)));
            }
        }
        files.extend(section.attachments.clone());
    }
    let findings: Vec<String> = sections.into_iter().map(|one| one.finding).collect();
    match files::write(out, files) {
        Ok(written) => Ok(Report { written, kept, findings }),
        Err(source) => Err(ReportError::Unwritten { findings, source }),
    }
}

/// The section cached in a file, if it is undamaged and its input is the same: its first line is a hash of both.
fn found(file: &Path, key: &str) -> Option<Section> {
    let content = std::fs::read_to_string(file).ok()?;
    let (first, text) = content.split_once('\n')?;
    (first == hash(&format!("{key}\n{text}"))).then(|| serde_json::from_str(text).ok())?
}

/// Everything that a section depends on.
fn key(subject: &Subject, section: &str) -> String {
    let axes = if section == "regimes" {
        let [x, y] = subject.map.each_ref().map(Axis::short_form);
        format!("{x} {y}")
    } else {
        String::new()
    };
    let scene = serde_json::to_string(&subject.scene).unwrap_or_default();
    let version = env!("CARGO_PKG_VERSION");
    format!("{section}\n{version}\n{axes}\n{scene}")
}

fn hash(text: &str) -> String {
    Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect()
}
