//! What a table or another file with channels contains.

mod plain;

pub use plain::plain_table;

/// A channel of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Channel {
    /// Its name in the file.
    pub name: String,
    /// The unit that the file states; empty without one.
    pub unit: String,
    /// Its samples; NaN where one is missing.
    pub values: Vec<f64>,
    /// The cells of a column of which one or more are neither a number nor empty; otherwise empty.
    pub texts: Vec<String>,
    /// Time of the first sample and distance of two samples, s, if the channel has a clock of its own.
    pub clock: Option<[f64; 2]>,
}

/// What a file contains.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contents {
    /// Name of the file.
    pub origin: String,
    /// How it was read, for messages: delimiter, decimal mark, encoding.
    pub layout: String,
    /// Whether the last row is cut off, and left out.
    pub is_cut_off: bool,
    /// Its channels.
    pub channels: Vec<Channel>,
    /// Line of the first sample; 0 in a file without lines.
    pub first_line: usize,
    /// What else may read a cell that is not a number.
    pub advice: &'static str,
    /// What in the file is no channel: names, and why.
    pub refused: Vec<[String; 2]>,
}
