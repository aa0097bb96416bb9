//! The sections of a report: text, figures and tables, one finding, and lines of the error budget.

use serde::{Deserialize, Serialize};

use super::files::ReportError;
use super::table::Table;
use crate::scene::{Family, Scene};
use crate::sweep::Axis;

/// The subject of a report.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// The scene again, for the sweep behind the regime map.
    pub family: Family,
    /// Axes of the regime map, horizontal first.
    pub map: [Axis; 2],
}

/// Computes one section; calls the callback with the fraction done, from 0 to 1.
pub type Maker = fn(&Subject, &(dyn Fn(f64) + Sync)) -> Result<Section, ReportError>;

/// One part of a section. A figure is SVG for white paper; its name is that of its files, without ending.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Block {
    Words(String),
    Figure { name: String, caption: String, svg: String },
    Table { caption: String, table: Table },
}

/// A section, with what was found in a sentence or two.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Section {
    pub title: String,
    pub finding: String,
    pub blocks: Vec<Block>,
    /// Lines of the error budget: what is uncertain, by how much, and where that number comes from.
    pub budget: Vec<[String; 3]>,
    /// Tables for programs: name and content of a file.
    pub attachments: Vec<(String, String)>,
}

impl Section {
    pub(super) fn new(title: &str) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// States the finding, in the summary and as a paragraph.
    pub(super) fn found(&mut self, finding: impl Into<String>) {
        self.finding = finding.into();
        self.words(self.finding.clone());
    }

    pub(super) fn words(&mut self, text: impl Into<String>) {
        self.blocks.push(Block::Words(text.into()));
    }

    pub(super) fn figure(&mut self, name: &str, caption: impl Into<String>, svg: String) {
        self.blocks
            .push(Block::Figure { name: name.into(), caption: caption.into(), svg });
    }

    pub(super) fn table(&mut self, caption: &str, table: Table) {
        self.blocks.push(Block::Table { caption: caption.into(), table });
    }

    pub(super) fn budget(&mut self, what: &str, size: String, why: &str) {
        self.budget.push([what.into(), size, why.into()]);
    }

    pub(super) fn attach(&mut self, name: &str, text: String) {
        self.attachments.push((name.into(), text));
    }
}
