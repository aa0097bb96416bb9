//! The Zarr store of a sweep: one array per variable and per axis, in a folder whose files are complete, with a checksum, or absent.
//!
//! Of the format (zarr.dev, version 3) a sweep needs little: metadata as JSON, and chunks of little-endian values or of texts with
//! their lengths, compressed with gzip, whose checksum finds damage.

use std::{
    error::Error,
    fs,
    hash::{BuildHasher, RandomState},
    io::{self, ErrorKind, Read as _},
    path::{Path, PathBuf},
};

use flate2::{
    Compression,
    bufread::{GzDecoder, GzEncoder},
};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use vines_model::regime::Regime;

use crate::{
    cell::{ABSENT, Cell, FAILED, NOT_COMPUTED, Read, UNCOUNTED, Variable},
    monitor::Monitor,
    sweep::{Shard, Sweep},
};

/// The metadata of the group. They are written first: a folder without them is empty, or something else.
const GROUP: &str = "zarr.json";
/// Where files are written before they get their name.
const PARTIAL: &str = ".partial";
/// Folder of the results of an adaptive sweep's rounds; removed at the end.
pub(crate) const ROUNDS: &str = ".rounds";
/// Compression level: the default of gzip.
const LEVEL: u32 = 6;

/// The store of a sweep.
pub(crate) struct Store<'a> {
    sweep: &'a Sweep,
    root: PathBuf,
    variables: Vec<Variable>,
}

impl<'a> Store<'a> {
    /// Opens the store of `sweep` in a folder, or creates it. Axes may be long: a part writes its share of what is missing of them, and the
    /// monitor ends this.
    pub(crate) fn open(sweep: &'a Sweep, root: &Path, shard: Shard, monitor: &Monitor) -> Result<Self, StoreError> {
        let store = Self::new(sweep, root);
        let exists = store.exists()?;
        if !exists {
            store.put(GROUP, &json_file(&store.group()))?;
        }
        store.check(if exists { shard } else { Shard::ALL }, monitor, |key, error, file| {
            if error.kind() != ErrorKind::NotFound {
                monitor.damaged(&root.join(key), error);
            }
            store.put(key, file)
        })?;
        Ok(store)
    }

    /// Opens the store of `sweep` in a folder that must have it; nothing is written.
    pub(crate) fn existing(sweep: &'a Sweep, root: &Path) -> Result<Self, StoreError> {
        let store = Self::new(sweep, root);
        match store.exists()? {
            true => Ok(store),
            false => Err(StoreError::NotAStore(root.into())),
        }
    }

    fn new(sweep: &'a Sweep, root: &Path) -> Self {
        Self {
            sweep,
            root: root.into(),
            variables: sweep.variables().collect(),
        }
    }

    /// Whether the folder has the store of the sweep; false if it has nothing.
    fn exists(&self) -> Result<bool, StoreError> {
        // Listed first: whoever else creates the store at the same time writes the group before all other files.
        let mut entries = fs::read_dir(&self.root).into_iter().flatten().flatten();
        let is_used = entries.any(|entry| entry.file_name() != PARTIAL);
        let text = match fs::read(self.root.join(GROUP)) {
            Ok(text) => text,
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(self.failed(error)),
            Err(_) if is_used => return Err(StoreError::NotAStore(self.root.clone())),
            Err(_) => return Ok(false),
        };
        let group: Value = serde_json::from_slice(&text).unwrap_or_default();
        let Some(Value::Object(found)) = group.pointer("/attributes/vines") else {
            return Err(StoreError::NotAStore(self.root.clone()));
        };
        // Both have been text once: the same digits give the same numbers.
        let here: Map<String, Value> = serde_json::from_str(&self.sweep.description().to_string()).unwrap_or_default();
        let differs = here.iter().filter(|(key, value)| found.get(*key) != Some(*value));
        let differs: Vec<String> = differs.map(|(key, _)| format!("`{key}`")).collect();
        if differs.is_empty() {
            return Ok(true);
        }
        Err(StoreError::Other { folder: self.root.clone(), differs: differs.join(", ") })
    }

    /// Names and metadata of all arrays: variables, then axes.
    fn arrays(&self) -> Map<String, Value> {
        let Sweep { dimensions, shape, chunk, .. } = self.sweep;
        let variables = self.variables.iter().map(|variable| {
            let metadata = array(variable.read.kind(), shape, chunk, dimensions, attributes(variable));
            (variable.name.into(), metadata)
        });
        let axes = self.sweep.coordinates().map(|(axis, n, _)| {
            let attributes = json!({ "long_name": axis.name, "units": axis.unit() });
            let metadata = array(FLOAT64, &shape[n..=n], &chunk[n..=n], &dimensions[n..=n], attributes);
            (axis.name.clone(), metadata)
        });
        variables.chain(axes).collect()
    }

    /// The metadata of the group, which contain the metadata of all arrays.
    fn group(&self) -> Value {
        let sampled = self.sweep.settings().axes.iter().filter(|axis| axis.points().is_none());
        let sampled: Vec<&str> = sampled.map(|axis| axis.name.as_str()).collect();
        json!({
            "zarr_format": 3,
            "node_type": "group",
            "attributes": {
                "title": "Sweep of a linear oscillator with a vibro-impact nonlinear energy sink",
                "coordinates": sampled.join(" "),
                "vines": self.sweep.description(),
            },
            "consolidated_metadata": { "kind": "inline", "must_understand": false, "metadata": self.arrays() },
        })
    }

    /// Looks for the metadata of the arrays, and verifies a share of the values of the axes, until the monitor stops it. `fault` gets the
    /// name of a file that is missing or damaged, what is wrong, and what it should contain.
    pub(crate) fn check(
        &self,
        shard: Shard,
        monitor: &Monitor,
        fault: impl Fn(&str, &io::Error, &[u8]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        for (name, metadata) in self.arrays() {
            let key = format!("{name}/{GROUP}");
            if let Err(error) = fs::metadata(self.root.join(&key)) {
                fault(&key, &error, &json_file(&metadata))?;
            }
        }
        for (axis, dimension, at) in self.sweep.coordinates() {
            let (length, chunk) = (self.sweep.shape[dimension], self.sweep.chunk[dimension]);
            for n in (shard.number..length.div_ceil(chunk)).step_by(shard.of as usize) {
                if monitor.stopped() {
                    return Ok(());
                }
                let key = chunk_key(&axis.name, &[n]);
                if let Err(error) = self.read(&key) {
                    let value = |k| if k < length { at(k) } else { f64::NAN };
                    let values: Vec<u8> = (n * chunk..(n + 1) * chunk)
                        .flat_map(|k| value(k).to_le_bytes())
                        .collect();
                    fault(&key, &error, &packed(&values))?;
                }
            }
        }
        Ok(())
    }

    /// Reads the files of a chunk and verifies their checksums; None if they are not all there and undamaged. Damage is noted.
    pub(crate) fn chunk(&self, index: &[u64], monitor: &Monitor) -> Option<Vec<Vec<u8>>> {
        let keys: Vec<String> = self
            .variables
            .iter()
            .map(|variable| chunk_key(variable.name, index))
            .collect();
        let files: Vec<io::Result<Vec<u8>>> = keys.iter().map(|key| Ok(self.read(key)?.0)).collect();
        let is_missing = |file: &io::Result<_>| file.as_ref().is_err_and(|error| error.kind() == ErrorKind::NotFound);
        if !files.iter().all(is_missing) {
            for (key, file) in keys.iter().zip(&files) {
                if let Err(error) = file {
                    monitor.damaged(&self.root.join(key), error);
                }
            }
        }
        files.into_iter().collect::<io::Result<_>>().ok()
    }

    /// Writes a chunk of cells, computed on all cores. False if the monitor stopped it: a cell is None.
    pub(crate) fn fill(&self, index: &[u64], cell: impl Fn(&[u64]) -> Option<Cell> + Sync) -> Result<bool, StoreError> {
        let cell = |n| match self.sweep.chunk_cell(index, n) {
            Some(inside) => cell(&inside),
            None => Some(Cell::default()),
        };
        let cells = (0..self.sweep.chunk_size()).into_par_iter().map(cell);
        let Some(cells) = cells.collect::<Option<Vec<Cell>>>() else {
            return Ok(false);
        };
        for variable in &self.variables {
            self.write(&chunk_key(variable.name, index), &variable.read.bytes(&cells))?;
        }
        Ok(true)
    }

    /// Writes the files of a chunk of another store of the same sweep.
    pub(crate) fn copy_chunk(&self, index: &[u64], files: &[Vec<u8>]) -> Result<(), StoreError> {
        let mut files = self.variables.iter().zip(files);
        files.try_for_each(|(variable, file)| self.put(&chunk_key(variable.name, index), file))
    }

    /// A compressed file whose checksum is right, and its content.
    pub(crate) fn read(&self, key: &str) -> io::Result<(Vec<u8>, Vec<u8>)> {
        let (file, mut content) = (fs::read(self.root.join(key))?, Vec::new());
        let mut decoder = GzDecoder::new(&file[..]);
        decoder.read_to_end(&mut content)?;
        match decoder.into_inner() {
            [] => Ok((file, content)),
            _ => Err(io::Error::new(ErrorKind::InvalidData, "it continues after its end")),
        }
    }

    /// Writes a compressed file.
    pub(crate) fn write(&self, key: &str, content: &[u8]) -> Result<(), StoreError> {
        self.put(key, &packed(content))
    }

    /// Writes a file completely or not at all: under another name first. Threads, processes and machines may write to one store, so that the name is
    /// a random number.
    fn put(&self, key: &str, content: &[u8]) -> Result<(), StoreError> {
        let (target, partial) = (self.root.join(key), self.root.join(PARTIAL));
        let path = partial.join(format!("{:016x}", RandomState::new().hash_one(key)));
        let complete = || {
            fs::create_dir_all(&partial)?;
            // Not flushed to the disk for each chunk: only a power failure needs it, and loses no more than the last chunks.
            fs::write(&path, content)?;
            target.parent().map_or(Ok(()), fs::create_dir_all)?;
            fs::rename(&path, &target)
        };
        complete().map_err(|error| {
            let _ = fs::remove_file(&path);
            self.failed(error)
        })
    }

    /// Removes what kills have left. Only for a complete store, to which nobody else writes.
    pub(crate) fn tidy(&self) -> Result<(), StoreError> {
        [ROUNDS, PARTIAL]
            .iter()
            .try_for_each(|name| match fs::remove_dir_all(self.root.join(name)) {
                Err(error) if error.kind() != ErrorKind::NotFound => Err(self.failed(error)),
                _ => Ok(()),
            })
    }

    fn failed(&self, source: io::Error) -> StoreError {
        StoreError::Write { folder: self.root.clone(), source }
    }
}

/// Compresses a content. The bytes depend on how the compressor is called: a writer gives others.
fn packed(content: &[u8]) -> Vec<u8> {
    let (mut encoder, mut file) = (GzEncoder::new(content, Compression::new(LEVEL)), Vec::new());
    encoder.read_to_end(&mut file).expect("memory can be read");
    file
}

/// Metadata as a file.
fn json_file(metadata: &Value) -> Vec<u8> {
    format!("{metadata:#}").into_bytes()
}

/// Where the file of a chunk is.
fn chunk_key(array: &str, index: &[u64]) -> String {
    let index: Vec<String> = index.iter().map(u64::to_string).collect();
    format!("{array}/c/{}", index.join("/"))
}

/// Type, codec of the values, and the value of a cell that is not computed.
type Kind = (&'static str, &'static str, Value);
const FLOAT64: Kind = ("float64", "bytes", Value::Null);

impl Read {
    fn kind(self) -> Kind {
        match self {
            Self::Number(_) => FLOAT64,
            Self::Count(_) => ("uint32", "bytes", UNCOUNTED.into()),
            Self::Regime => ("uint8", "bytes", ABSENT.into()),
            Self::Failure => ("string", "vlen-utf8", NOT_COMPUTED.into()),
        }
    }

    /// The values of cells as bytes.
    fn bytes(self, cells: &[Cell]) -> Vec<u8> {
        match self {
            Self::Number(of) => cells
                .iter()
                .flat_map(|cell| of(cell).unwrap_or(f64::NAN).to_le_bytes())
                .collect(),
            Self::Count(of) => cells
                .iter()
                .flat_map(|cell| of(cell).unwrap_or(UNCOUNTED).to_le_bytes())
                .collect(),
            Self::Regime => cells.iter().map(Cell::code).collect(),
            Self::Failure => {
                let mut bytes = (cells.len() as u32).to_le_bytes().to_vec();
                for cell in cells {
                    let reason = if cell.is_known() { &cell.failure } else { NOT_COMPUTED };
                    bytes.extend((reason.len() as u32).to_le_bytes());
                    bytes.extend(reason.as_bytes());
                }
                bytes
            }
        }
    }
}

/// The metadata of an array.
fn array(kind: Kind, shape: &[u64], chunk: &[u64], dimensions: &[String], attributes: Value) -> Value {
    let (data_type, codec, fill) = kind;
    let mut codec = json!({ "name": codec });
    if data_type != "string" {
        codec["configuration"] = json!({ "endian": "little" });
    }
    json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": data_type,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "fill_value": if fill.is_null() { "NaN".into() } else { fill },
        "codecs": [codec, { "name": "gzip", "configuration": { "level": LEVEL } }],
        "attributes": attributes,
        "dimension_names": dimensions,
    })
}

/// The attributes of a variable.
fn attributes(variable: &Variable) -> Value {
    let mut attributes = json!({ "long_name": variable.meaning });
    if !variable.unit.is_empty() {
        attributes["units"] = variable.unit.into();
    }
    match variable.read {
        Read::Regime => {
            let codes = (0..).zip(Regime::SIMULATED.map(|regime| regime.name().replace(' ', "_")));
            let others = [(FAILED, "failed".into()), (ABSENT, "not_computed".into())];
            let (values, names): (Vec<u8>, Vec<String>) = codes.chain(others).unzip();
            attributes["flag_values"] = values.into();
            attributes["flag_meanings"] = names.join(" ").into();
        }
        // By this attribute, and not by the fill value of Zarr, xarray makes NaN of absent counts.
        Read::Count(_) => attributes["_FillValue"] = UNCOUNTED.into(),
        Read::Number(_) | Read::Failure => {}
    }
    attributes
}

/// Why a store cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum StoreError {
    #[error(
        "{} belongs to another sweep, with another {differs}. It stays as it is; write to another folder, or delete it",
        folder.display()
    )]
    Other { folder: PathBuf, differs: String },
    #[error(
        "{} is not the store of a sweep: its zarr.json, which says to which sweep it belongs, is missing or damaged. \
         It stays as it is; name another folder",
        .0.display()
    )]
    NotAStore(PathBuf),
    #[error(
        "an adaptive sweep cannot be computed in parts: what is computed next depends on all cells. Leave out the part"
    )]
    Part,
    #[error("cannot write to {}: {source}. Complete chunks stay; the same command continues the sweep", folder.display())]
    Write { folder: PathBuf, source: io::Error },
}

impl StoreError {
    /// Number of the system's error, if it is one.
    #[must_use]
    pub fn os_error(&self) -> Option<i32> {
        self.source()?.downcast_ref::<io::Error>()?.raw_os_error()
    }
}
