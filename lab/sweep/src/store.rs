//! The Zarr store of a sweep: one array per variable and per axis.

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::{Arc, atomic::Ordering::Relaxed},
};

use serde_json::{Map, Value, json};
use vines_model::regime::Regime;
use zarrs::array::{
    Array, ArrayBuilder, ArrayError, CodecOptions, DataType, builder::ArrayBuilderFillValue, codec::GzipCodec,
    data_type,
};
use zarrs::storage::StoreKey;

use crate::{
    axis::Axis,
    cell::Cell,
    error::StoreError,
    folder::{Folder, PARTIAL},
    gzip::{Fault, LEVEL, pack, unpack},
    monitor::Monitor,
    plan::{Plan, Shard},
    variables::{ABSENT, FAILED, Read, UNCOUNTED, Variable, code, count, reason, variables},
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
    /// Opens the store of `plan` in a folder, or creates it, and restores damaged metadata. Axes may be long: a part checks its share of
    /// them, and the monitor ends this with an error.
    pub(crate) fn open(plan: &Plan, root: &Path, shard: Shard, monitor: &Monitor) -> Result<Self, StoreError> {
        let store = Self::new(plan, root)?;
        let created = if store.is_there(plan)? {
            store.describe(plan, shard, monitor, Repair::Restore)
        } else {
            store.describe(plan, Shard::ALL, monitor, Repair::Create)
        };
        created.map_err(|error| store.failed(error))?;
        Ok(store)
    }

    /// Opens the store of `plan` in a folder that must have it; nothing is written.
    pub(crate) fn existing(plan: &Plan, root: &Path) -> Result<Self, StoreError> {
        let store = Self::new(plan, root)?;
        match store.is_there(plan)? {
            true => Ok(store),
            false => Err(StoreError::NotAStore(root.into())),
        }
    }

    /// Reports damage of metadata and axes to the monitor.
    pub(crate) fn inspect(&self, plan: &Plan, shard: Shard, monitor: &Monitor) -> Result<(), StoreError> {
        self.describe(plan, shard, monitor, Repair::Report)
            .map_err(|error| self.failed(error))
    }

    fn new(plan: &Plan, root: &Path) -> Result<Self, StoreError> {
        let folder = Arc::new(Folder::new(root));
        let arrays = variables(plan.settings()).map(|one| Ok((one, variable(plan, &folder, &one)?)));
        let axes = plan
            .coordinates()
            .map(|(one, _, dimension)| axis(plan, &folder, one, dimension));
        let failed = |source| StoreError::Write { folder: root.into(), source };
        Ok(Self {
            arrays: arrays.collect::<Result<_, Failed>>().map_err(failed)?,
            axes: axes.collect::<Result<_, Failed>>().map_err(failed)?,
            folder,
            root: root.into(),
        })
    }

    /// Whether the folder has the store of `plan`. False if it has nothing, or what a program left that was killed before it wrote the
    /// group.
    fn is_there(&self, plan: &Plan) -> Result<bool, StoreError> {
        match fs::read(self.root.join(GROUP)) {
            Ok(text) => {
                if let Ok(group) = serde_json::from_slice::<Value>(&text) {
                    return self.check(plan, &group).map(|()| true);
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
    fn describe(&self, plan: &Plan, shard: Shard, monitor: &Monitor, repair: Repair) -> Result<(), Failed> {
        let note = |key: &str, fault: &Fault| {
            if repair != Repair::Create {
                monitor.damaged(&self.folder.path(key), fault);
            }
        };
        let compare = |key: &str, metadata: &Value| -> Result<(), Failed> {
            let fault = match fs::read(self.folder.path(key)) {
                Ok(text) => match serde_json::from_slice(&text) {
                    Ok(found) if contains(&found, metadata) => return Ok(()),
                    _ => Fault::Content,
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
        for (array, (_, sequence, dimension)) in self.axes.iter().zip(plan.coordinates()) {
            let (length, chunk) = (plan.shape[dimension], plan.chunk[dimension]);
            for n in (shard.number..length.div_ceil(chunk)).step_by(shard.of as usize) {
                if monitor.stop.load(Relaxed) {
                    return Err("stopped".into());
                }
                let value = |k| if k < length { sequence.at(k) } else { f64::NAN };
                let values: Vec<f64> = (n * chunk..(n + 1) * chunk).map(value).collect();
                let key = array.chunk_key(&[n]);
                let fault = match self.folder.read(key.as_str()) {
                    Ok(found) if found == values.iter().flat_map(|one| one.to_le_bytes()).collect::<Vec<u8>>() => {
                        continue;
                    }
                    Ok(_) => Fault::Content,
                    Err(fault) => fault,
                };
                note(key.as_str(), &fault);
                if repair != Repair::Report {
                    array.store_chunk_opt(&[n], values, &options())?;
                }
            }
        }
        compare(GROUP, &group(plan, all))
    }

    /// Compares the metadata of an existing store with the plan.
    fn check(&self, plan: &Plan, group: &Value) -> Result<(), StoreError> {
        let Some(Value::Object(found)) = group.pointer("/attributes/vines") else {
            return Err(StoreError::NotAStore(self.root.clone()));
        };
        // Both have been text once: the same digits give the same numbers.
        let here = object(serde_json::from_str(&plan.description().to_string()).unwrap_or_default());
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

fn variable(plan: &Plan, folder: &Arc<Folder>, variable: &Variable) -> Result<Array<Folder>, Failed> {
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
        ArrayBuilder::new(plan.shape.clone(), plan.chunk.clone(), data_type, fill)
            .bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(LEVEL)?)])
            .dimension_names(Some(plan.dimensions.iter().map(String::as_str)))
            .attributes(object(attributes))
            .build(folder.clone(), &format!("/{}", variable.name))?,
    )
}

/// The array of an axis.
fn axis(plan: &Plan, folder: &Arc<Folder>, axis: &Axis, dimension: usize) -> Result<Array<Folder>, Failed> {
    let attributes = json!({ "long_name": axis.name, "units": axis.unit() });
    let (length, chunk) = (plan.shape[dimension], plan.chunk[dimension]);
    Ok(
        ArrayBuilder::new(vec![length], vec![chunk], data_type::float64(), f64::NAN)
            .bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(LEVEL)?)])
            .dimension_names(Some([plan.dimensions[dimension].as_str()]))
            .attributes(object(attributes))
            .build(folder.clone(), &format!("/{}", axis.name))?,
    )
}

/// The metadata of the group, with those of all arrays.
fn group(plan: &Plan, arrays: Map<String, Value>) -> Value {
    let sampled: Vec<&str> = plan
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
            "vines": plan.description(),
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
