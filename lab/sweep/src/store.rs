//! The Zarr store of a sweep: one array per variable and per axis, in a folder whose files are complete, with a checksum, or absent.

use std::{
    error::Error,
    fs,
    hash::{BuildHasher, RandomState},
    io::{self, Read as _, Write as _},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
};

use flate2::{Compression, bufread::GzDecoder, write::GzEncoder};
use serde_json::{Map, Value, json};
use vines_model::regime::Regime;
use zarrs::array::{
    Array, ArrayBuilder, ArrayCreateError, ArrayError, CodecOptions, DataType, builder::ArrayBuilderFillValue,
    codec::GzipCodec, data_type,
};
use zarrs::storage::{Bytes, OffsetBytesIterator, StorageError, StoreKey, StorePrefix, WritableStorageTraits};

use crate::{
    axis::Axis,
    cell::{ABSENT, Cell, FAILED, Read, UNCOUNTED, Variable, code, count, reason, variables},
    run::Monitor,
    sweep::{Shard, Sweep},
};

/// Folder of the results of an adaptive sweep's rounds; removed at the end.
pub(crate) const ROUNDS: &str = ".rounds";

/// An open store.
pub(crate) struct Store {
    folder: Arc<Folder>,
    root: PathBuf,
    arrays: Vec<(Variable, Array<Folder>)>,
    /// The arrays of the axes.
    axes: Vec<Array<Folder>>,
}

/// A chunk of all variables.
pub(crate) enum Chunk {
    /// Not computed yet.
    Absent,
    /// The content of its files.
    Complete(Vec<Vec<u8>>),
    /// Files are missing or damaged.
    Damaged,
}

/// What happens to metadata and axes that are not as the sweep writes them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Repair {
    /// They are written: the store is new.
    Create,
    /// They are noted and written.
    Restore,
    /// They are noted.
    Report,
}

/// The file of the group. It is written last: where it is, the metadata is complete.
const GROUP: &str = "zarr.json";
/// What differs in the metadata if only the program does.
const VERSION: &str = "version";

type Failed = Box<dyn std::error::Error + Send + Sync>;

impl Store {
    /// Opens the store of `sweep` in a folder, or creates it, and restores damaged metadata. Axes may be long: a part checks its share of
    /// them, and the monitor ends this with an error.
    pub(crate) fn open(sweep: &Sweep, root: &Path, shard: Shard, monitor: &Monitor) -> Result<Self, StoreError> {
        let store = Self::new(sweep, root)?;
        let created = if store.is_there(sweep)? {
            store.describe(sweep, shard, monitor, Repair::Restore)
        } else {
            store.describe(sweep, Shard::ALL, monitor, Repair::Create)
        };
        created.map_err(|error| store.failed(error))?;
        Ok(store)
    }

    /// Opens the store of `sweep` in a folder that must have it; nothing is written.
    pub(crate) fn existing(sweep: &Sweep, root: &Path) -> Result<Self, StoreError> {
        let store = Self::new(sweep, root)?;
        match store.is_there(sweep)? {
            true => Ok(store),
            false => Err(StoreError::NotAStore(root.into())),
        }
    }

    /// Reports damage of metadata and axes to the monitor.
    pub(crate) fn inspect(&self, sweep: &Sweep, shard: Shard, monitor: &Monitor) -> Result<(), StoreError> {
        self.describe(sweep, shard, monitor, Repair::Report)
            .map_err(|error| self.failed(error))
    }

    fn new(sweep: &Sweep, root: &Path) -> Result<Self, StoreError> {
        let folder = Arc::new(Folder::new(root));
        let arrays = variables(sweep.settings()).map(|one| Ok((one, variable(sweep, &folder, &one)?)));
        let axes = sweep
            .coordinates()
            .map(|(one, dimension, _)| axis(sweep, &folder, one, dimension));
        let failed = |source| StoreError::Write { folder: root.into(), source };
        Ok(Self {
            arrays: arrays.collect::<Result<_, Failed>>().map_err(failed)?,
            axes: axes.collect::<Result<_, Failed>>().map_err(failed)?,
            folder,
            root: root.into(),
        })
    }

    /// Whether the folder has the store of `sweep`. False if it has nothing, or what a program left that was killed before it wrote the
    /// group.
    fn is_there(&self, sweep: &Sweep) -> Result<bool, StoreError> {
        match fs::read(self.root.join(GROUP)) {
            Ok(text) => {
                if let Ok(group) = serde_json::from_slice::<Value>(&text) {
                    return self.check(sweep, &group).map(|()| true);
                }
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(self.failed(error)),
        }
        let all = || self.arrays.iter().map(|(_, array)| array).chain(&self.axes);
        let names: Vec<&str> = all().map(name).chain([GROUP, PARTIAL, ROUNDS]).collect();
        // A folder is made before the file that goes into it.
        let empty = |path: &Path| fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none());
        let ours = |entry: fs::DirEntry| names.iter().any(|name| entry.file_name() == *name) || empty(&entry.path());
        if fs::read_dir(&self.root).is_ok_and(|entries| !entries.flatten().all(ours)) {
            return Err(StoreError::NotAStore(self.root.clone()));
        }
        let mut results = self.arrays.iter().map(|(variable, _)| format!("{}/c", variable.name));
        if results.any(|key| self.folder.path(&key).exists()) || self.folder.path(ROUNDS).exists() {
            return Err(StoreError::Group(self.root.clone()));
        }
        Ok(false)
    }

    /// Compares metadata and axes with what the sweep writes.
    fn describe(&self, sweep: &Sweep, shard: Shard, monitor: &Monitor, repair: Repair) -> Result<(), Failed> {
        let note = |key: &str, fault: &Fault| {
            if repair != Repair::Create {
                monitor.damaged(&self.folder.path(key), fault);
            }
        };
        let compare = |key: &str, metadata: &Value| -> Result<(), Failed> {
            let fault = match fs::read(self.folder.path(key)) {
                Ok(text) => match serde_json::from_slice(&text) {
                    Ok(found) if contains(&found, metadata) => return Ok(()),
                    _ => Fault::Damaged("is not what the sweep wrote"),
                },
                Err(error) => error.into(),
            };
            note(key, &fault);
            if repair != Repair::Report {
                self.folder.write(key, &serde_json::to_vec_pretty(metadata)?)?;
            }
            Ok(())
        };
        let mut all = Map::new();
        for array in self.arrays.iter().map(|(_, array)| array).chain(&self.axes) {
            let metadata = serde_json::to_value(array.metadata())?;
            compare(&format!("{}/{GROUP}", name(array)), &metadata)?;
            all.insert(name(array).into(), metadata);
        }
        for (array, (_, dimension, at)) in self.axes.iter().zip(sweep.coordinates()) {
            let (length, chunk) = (sweep.shape[dimension], sweep.chunk[dimension]);
            for n in (shard.number..length.div_ceil(chunk)).step_by(shard.of as usize) {
                if monitor.stop.load(Relaxed) {
                    return Err("stopped".into());
                }
                let value = |k| if k < length { at(k) } else { f64::NAN };
                let values: Vec<f64> = (n * chunk..(n + 1) * chunk).map(value).collect();
                let key = array.chunk_key(&[n]);
                let fault = match self.folder.read(key.as_str()) {
                    Ok(found) if found == values.iter().flat_map(|one| one.to_le_bytes()).collect::<Vec<u8>>() => {
                        continue;
                    }
                    Ok(_) => Fault::Damaged("is not what the sweep wrote"),
                    Err(fault) => fault,
                };
                note(key.as_str(), &fault);
                if repair != Repair::Report {
                    array.store_chunk_opt(&[n], values, &options())?;
                }
            }
        }
        compare(GROUP, &group(sweep, all))
    }

    /// Compares the metadata of an existing store with the sweep.
    fn check(&self, sweep: &Sweep, group: &Value) -> Result<(), StoreError> {
        let Some(Value::Object(found)) = group.pointer("/attributes/vines") else {
            return Err(StoreError::NotAStore(self.root.clone()));
        };
        // Both have been text once: the same digits give the same numbers.
        let here = object(serde_json::from_str(&sweep.description().to_string()).unwrap_or_default());
        let differs: Vec<&str> = here
            .iter()
            .filter(|(key, value)| found.get(*key) != Some(*value))
            .map(|(key, _)| key.as_str())
            .collect();
        let folder = self.root.clone();
        match &differs[..] {
            [] => Ok(()),
            [VERSION] => {
                let of = |from: &Map<String, Value>| {
                    let version = from.get(VERSION).and_then(Value::as_str);
                    version.unwrap_or("unknown").to_string()
                };
                Err(StoreError::Build { folder, found: of(found), here: of(&here) })
            }
            some => {
                let differs = some.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
                Err(StoreError::Other { folder, differs })
            }
        }
    }

    /// Reads a chunk and verifies its checksums. What is wrong with it is noted.
    pub(crate) fn chunk(&self, index: &[u64], monitor: &Monitor) -> Chunk {
        let keys: Vec<StoreKey> = self.arrays.iter().map(|(_, array)| array.chunk_key(index)).collect();
        let mut files = Vec::with_capacity(keys.len());
        let mut faults = Vec::new();
        for key in &keys {
            let file = fs::read(self.folder.path(key.as_str())).map_err(Fault::from);
            match file.and_then(|file| unpack(&file).map(|_| file)) {
                Ok(file) => files.push(file),
                Err(fault) => faults.push((key, fault)),
            }
        }
        if faults.is_empty() {
            return Chunk::Complete(files);
        }
        if files.is_empty() && faults.iter().all(|(_, fault)| matches!(fault, Fault::Missing)) {
            return Chunk::Absent;
        }
        for (key, fault) in faults {
            monitor.damaged(&self.folder.path(key.as_str()), &fault);
        }
        Chunk::Damaged
    }

    /// Writes all variables of a chunk.
    pub(crate) fn write(&self, index: &[u64], cells: &[Cell]) -> Result<(), StoreError> {
        let options = options();
        let write = |(variable, array): &(Variable, Array<Folder>)| -> Result<(), ArrayError> {
            match variable.read {
                Read::Number(of) => array.store_chunk_opt(index, cells.iter().map(of).collect::<Vec<f64>>(), &options),
                Read::Count(of) => {
                    let counts: Vec<u32> = cells.iter().map(|cell| count(of, cell)).collect();
                    array.store_chunk_opt(index, counts, &options)
                }
                Read::Regime => array.store_chunk_opt(index, cells.iter().map(code).collect::<Vec<u8>>(), &options),
                Read::Failure => array.store_chunk_opt(index, cells.iter().map(reason).collect::<Vec<_>>(), &options),
            }
        };
        self.arrays
            .iter()
            .try_for_each(write)
            .map_err(|error| self.failed(error))
    }

    /// Writes the files of a chunk of another store of the same sweep.
    pub(crate) fn copy(&self, index: &[u64], files: &[Vec<u8>]) -> Result<(), StoreError> {
        self.arrays.iter().zip(files).try_for_each(|((_, array), file)| {
            self.folder
                .write(array.chunk_key(index).as_str(), file)
                .map_err(|error| self.failed(error))
        })
    }

    /// What was kept beside the arrays under this key; None if there is nothing, or if it is damaged, which is noted.
    pub(crate) fn kept(&self, key: &str, monitor: &Monitor) -> Option<Vec<u8>> {
        let kept = self.folder.read(key);
        if let Err(fault) = &kept
            && !matches!(fault, Fault::Missing)
        {
            monitor.damaged(&self.folder.path(key), fault);
        }
        kept.ok()
    }

    /// Keeps something beside the arrays until the store is complete.
    pub(crate) fn keep(&self, key: &str, content: &[u8]) -> Result<(), StoreError> {
        pack(content)
            .and_then(|file| self.folder.write(key, &file))
            .map_err(|error| self.failed(error))
    }

    fn failed(&self, source: impl Into<Failed>) -> StoreError {
        StoreError::Write { folder: self.root.clone(), source: source.into() }
    }

    /// Removes what kills have left. Only for a complete store, to which nobody else writes.
    pub(crate) fn tidy(&self) -> Result<(), StoreError> {
        [ROUNDS, PARTIAL]
            .iter()
            .try_for_each(|name| self.folder.remove(name))
            .map_err(|error| StoreError::Write { folder: self.root.clone(), source: error.into() })
    }
}

fn variable(sweep: &Sweep, folder: &Arc<Folder>, variable: &Variable) -> Result<Array<Folder>, Failed> {
    // A cell without a file looks as one that is not computed.
    let absent = Cell::default();
    let (data_type, fill): (DataType, ArrayBuilderFillValue) = match variable.read {
        Read::Number(_) => (data_type::float64(), f64::NAN.into()),
        Read::Count(of) => (data_type::uint32(), count(of, &absent).into()),
        Read::Regime => (data_type::uint8(), code(&absent).into()),
        Read::Failure => (data_type::string(), reason(&absent).into()),
    };
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
    Ok(
        ArrayBuilder::new(sweep.shape.clone(), sweep.chunk.clone(), data_type, fill)
            .bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(LEVEL)?)])
            .dimension_names(Some(sweep.dimensions.iter().map(String::as_str)))
            .attributes(object(attributes))
            .build(folder.clone(), &format!("/{}", variable.name))?,
    )
}

/// The array of an axis.
fn axis(sweep: &Sweep, folder: &Arc<Folder>, axis: &Axis, dimension: usize) -> Result<Array<Folder>, Failed> {
    let attributes = json!({ "long_name": axis.name, "units": axis.unit() });
    let (length, chunk) = (sweep.shape[dimension], sweep.chunk[dimension]);
    Ok(
        ArrayBuilder::new(vec![length], vec![chunk], data_type::float64(), f64::NAN)
            .bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(LEVEL)?)])
            .dimension_names(Some([sweep.dimensions[dimension].as_str()]))
            .attributes(object(attributes))
            .build(folder.clone(), &format!("/{}", axis.name))?,
    )
}

/// The metadata of the group, which contain the metadata of all arrays.
fn group(sweep: &Sweep, arrays: Map<String, Value>) -> Value {
    let sampled: Vec<&str> = sweep
        .coordinates()
        .filter(|(axis, ..)| axis.points().is_none())
        .map(|(axis, ..)| axis.name.as_str())
        .collect();
    json!({
        "zarr_format": 3,
        "node_type": "group",
        "attributes": {
            "title": "Sweep of a linear oscillator with a vibro-impact nonlinear energy sink",
            "coordinates": sampled.join(" "),
            "vines": sweep.description(),
        },
        "consolidated_metadata": { "kind": "inline", "must_understand": false, "metadata": arrays },
    })
}

/// Name of an array: its path in the store.
fn name(array: &Array<Folder>) -> &str {
    array.path().as_str().trim_start_matches('/')
}

/// Whether metadata have at least these entries: users may add attributes.
fn contains(found: &Value, expected: &Value) -> bool {
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) => expected
            .iter()
            .all(|(key, value)| found.get(key).is_some_and(|one| contains(one, value))),
        _ => found == expected,
    }
}

/// A chunk in which all is absent is written too: its file says that it is complete.
fn options() -> CodecOptions {
    CodecOptions::default().with_store_empty_chunks(true)
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// Why a store cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The store belongs to another sweep.
    #[error(
        "{} belongs to another sweep, with another {differs}. It stays as it is; write to another folder, or delete it",
        folder.display()
    )]
    Other {
        /// The folder.
        folder: PathBuf,
        /// What differs.
        differs: String,
    },
    /// The store is of the same sweep, computed by another program.
    #[error(
        "{} was computed by another version of vines ({found}, here {here}), and results of both must not be mixed. \
         It stays as it is; continue it with the version that began it, or write to another folder",
        folder.display()
    )]
    Build {
        /// The folder.
        folder: PathBuf,
        /// Version of the store.
        found: String,
        /// Version of this program.
        here: String,
    },
    /// Chunks without the file that says to which sweep they belong.
    #[error(
        "{} has chunks, but its zarr.json, which says to which sweep they belong, is missing or damaged. \
         The store stays as it is; restore that file, delete the folder, or name another one",
        .0.display()
    )]
    Group(PathBuf),
    /// The folder holds something else.
    #[error("{} is not the store of a sweep; name another folder", .0.display())]
    NotAStore(PathBuf),
    /// An adaptive sweep in parts.
    #[error(
        "an adaptive sweep cannot be computed in parts: what is computed next depends on all cells. Leave out the part"
    )]
    Part,
    /// Reading or writing failed.
    #[error("cannot write to {}: {source}. Complete chunks stay; the same command continues the sweep", folder.display())]
    Write {
        /// The folder.
        folder: PathBuf,
        /// Error of the system or of the format.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl StoreError {
    /// Number of the system's error, if it is one.
    #[must_use]
    pub fn os_error(&self) -> Option<i32> {
        let mut cause: Option<&(dyn Error + 'static)> = Some(self);
        while let Some(one) = cause {
            // Those of zarrs hide their cause.
            let storage = match (one.downcast_ref(), one.downcast_ref()) {
                (Some(ArrayError::StorageError(storage)), _) => Some(storage),
                (_, Some(ArrayCreateError::StorageError(storage))) => Some(storage),
                _ => one.downcast_ref(),
            };
            let system = match storage {
                Some(StorageError::IOError(error)) => Some(&**error),
                _ => one.downcast_ref::<io::Error>(),
            };
            if let Some(number) = system.and_then(io::Error::raw_os_error) {
                return Some(number);
            }
            cause = one.source();
        }
        None
    }
}

/// Where files are written before they get their name.
pub(crate) const PARTIAL: &str = ".partial";

/// A folder. (The storage of the crate `zarrs_filesystem` writes in place, and remembers every key.)
#[derive(Debug)]
pub(crate) struct Folder {
    root: PathBuf,
    /// A random number. Threads, processes and machines may write to one store: numbers of processes repeat on other machines.
    writer: u64,
    written: AtomicU64,
}

impl Folder {
    pub(crate) fn new(root: &Path) -> Self {
        Self {
            root: root.into(),
            writer: RandomState::new().hash_one(0),
            written: AtomicU64::new(0),
        }
    }

    pub(crate) fn path(&self, key: &str) -> PathBuf {
        self.root.join(key)
    }

    /// The content of a file that ends with its checksum.
    pub(crate) fn read(&self, key: &str) -> Result<Vec<u8>, Fault> {
        unpack(&fs::read(self.path(key))?)
    }

    /// Writes a file completely or not at all: under another name first.
    pub(crate) fn write(&self, key: &str, content: &[u8]) -> io::Result<()> {
        let target = self.path(key);
        let path = self.partial();
        fs::create_dir_all(self.path(PARTIAL))?;
        let complete = || {
            // Not flushed to the disk for each chunk: only a power failure needs it, and loses no more than the last chunks.
            fs::write(&path, content)?;
            if let Some(parent) = target.parent() {
                fs::create_dir_all(parent)?;
            }
            fs::rename(&path, &target)
        };
        complete().inspect_err(|_| drop(fs::remove_file(&path)))
    }

    /// A new name for a file that is not complete.
    fn partial(&self) -> PathBuf {
        let number = self.written.fetch_add(1, Relaxed);
        self.path(PARTIAL).join(format!("{:016x}-{number}", self.writer))
    }

    /// Removes a folder inside, if it is there.
    pub(crate) fn remove(&self, name: &str) -> io::Result<()> {
        match fs::remove_dir_all(self.path(name)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}

impl WritableStorageTraits for Folder {
    fn set(&self, key: &StoreKey, value: Bytes) -> Result<(), StorageError> {
        Ok(self.write(key.as_str(), &value)?)
    }

    fn set_partial_many(&self, _: &StoreKey, _: OffsetBytesIterator) -> Result<(), StorageError> {
        Err(StorageError::Unsupported("files are written as a whole".into()))
    }

    fn erase(&self, key: &StoreKey) -> Result<(), StorageError> {
        Ok(fs::remove_file(self.path(key.as_str()))?)
    }

    fn erase_prefix(&self, prefix: &StorePrefix) -> Result<(), StorageError> {
        Ok(fs::remove_dir_all(self.path(prefix.as_str()))?)
    }

    fn supports_set_partial(&self) -> bool {
        false
    }
}

/// Compression level: the default of gzip.
pub(crate) const LEVEL: u32 = 6;

/// The header that encoder and Zarr codec write: no name, no time. The checksum does not cover it.
const HEADER: [u8; 10] = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0xff];

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    #[error("is missing")]
    Missing,
    #[error("{0}")]
    Damaged(&'static str),
    #[error("cannot be read ({0})")]
    Unreadable(io::Error),
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::Missing,
            _ => Self::Unreadable(error),
        }
    }
}

/// Compresses a content.
pub(crate) fn pack(content: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(LEVEL));
    encoder.write_all(content)?;
    encoder.finish()
}

/// The content of a file whose checksum is right.
pub(crate) fn unpack(file: &[u8]) -> Result<Vec<u8>, Fault> {
    if file.is_empty() {
        return Err(Fault::Damaged("is empty"));
    }
    if !HEADER.starts_with(&file[..file.len().min(HEADER.len())]) {
        return Err(Fault::Damaged("has a damaged header"));
    }
    let mut decoder = GzDecoder::new(file);
    let mut content = Vec::new();
    match decoder.read_to_end(&mut content) {
        Ok(_) if decoder.into_inner().is_empty() => Ok(content),
        Ok(_) => Err(Fault::Damaged("continues after its end")),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(Fault::Damaged("is truncated")),
        Err(_) => Err(Fault::Damaged("has a damaged content or checksum")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writers_in_one_process_or_in_processes_of_the_same_number_do_not_share_partial_files() {
        let [one, other] = [(); 2].map(|()| Folder::new(Path::new("store")));
        assert_ne!(one.partial(), other.partial());
        assert_ne!(one.partial(), one.partial());
    }
}
