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

impl Contents {
    /// The unit that the file states for the channel of this name, empty without one; `None` without such a channel.
    pub fn unit(&self, name: &str) -> Option<&str> {
        let channel = self.channels.iter().find(|one| one.name == name);
        channel.map(|channel| &*channel.unit)
    }

    /// The rows of a table: numbers and texts by the names of the channels. Channels of other lengths have none.
    pub fn rows(&self) -> impl Iterator<Item = Vec<(&str, String)>> {
        let cell = |channel: &Channel, n: usize| match channel.texts.get(n) {
            Some(text) => Some(text.clone()),
            None => channel.values.get(n).map(f64::to_string),
        };
        let row = move |n| {
            let cells = self.channels.iter();
            cells
                .filter_map(|one| Some((one.name.as_str(), cell(one, n)?)))
                .collect()
        };
        let count = self.channels.iter().map(|one| one.values.len()).max();
        (0..count.unwrap_or(0)).map(row)
    }

    /// A refusal, with the channels as they were read.
    pub fn refusal(&self, message: &str) -> String {
        let after = |sign: char, text: &str, end: char| match text {
            "" => String::new(),
            text => format!(" {sign}{text}{end}"),
        };
        let line = |(n, Channel { name, unit, values, texts, .. }): (usize, &Channel)| {
            let numbers = values.iter().take(3).map(f64::to_string);
            let first: Vec<String> = match texts.is_empty() {
                true => numbers.collect(),
                false => texts.iter().take(3).cloned().collect(),
            };
            let (unit, first, count) = (after('[', unit, ']'), first.join(", "), values.len());
            format!("\n  {}  {name}{unit}: {first} ... ({count} values)", n + 1)
        };
        let lines: String = self.channels.iter().enumerate().take(20).map(line).collect();
        let more = match self.channels.len().saturating_sub(20) {
            0 => String::new(),
            more => format!("\n  and {more} more"),
        };
        let (origin, layout) = (&self.origin, after('(', &self.layout, ')'));
        format!("{origin}{message}\nThe file as it was read{layout}:{lines}{more}")
    }
}
