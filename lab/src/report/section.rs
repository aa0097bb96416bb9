//! The sections of a report: text, figures and tables, one finding, and lines of the error budget.

use serde::{Deserialize, Serialize};

use super::table::Table;

/// One part of a section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Block {
    /// A paragraph.
    Words(String),
    /// A figure, as SVG for white paper.
    Figure {
        /// Name of its files, without ending.
        name: String,
        /// What it shows.
        caption: String,
        /// The drawing.
        svg: String,
    },
    /// A table.
    Table {
        /// What it shows.
        caption: String,
        /// Its cells.
        table: Table,
    },
}

/// A file beside the page.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Attachment {
    /// Its name.
    pub name: String,
    /// Its content.
    pub text: String,
}

/// One line of the error budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Budget {
    /// What is uncertain.
    pub what: String,
    /// By how much.
    pub size: String,
    /// Source and meaning of that number.
    pub why: String,
}

/// A section.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Section {
    /// Its heading.
    pub title: String,
    /// What was found, in a sentence or two.
    pub finding: String,
    /// Its body.
    pub blocks: Vec<Block>,
    /// Its lines of the error budget.
    pub budget: Vec<Budget>,
    /// Tables for programs.
    pub attachments: Vec<Attachment>,
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
        self.budget.push(Budget { what: what.into(), size, why: why.into() });
    }

    pub(super) fn attach(&mut self, name: &str, text: String) {
        self.attachments.push(Attachment { name: name.into(), text });
    }
}
