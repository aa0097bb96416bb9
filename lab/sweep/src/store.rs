//! The Zarr store of a sweep: one array per variable and per axis.

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
};

use serde_json::{Map, Value, json};
use vines_model::regime::Regime;
use zarrs::array::{
    Array, ArrayBuilder, ArrayError, CodecOptions, DataType, builder::ArrayBuilderFillValue, codec::GzipCodec,
    data_type,
};

use crate::{
    cell::Cell,
    error::StoreError,
    folder::{Folder, PARTIAL},
    plan::Plan,
    variables::{ABSENT, Read, Variable, variables},
};

/// Folder of the results of an adaptive sweep's rounds; removed at the end.
pub(crate) const ROUNDS: &str = ".rounds";

/// An open store.
pub(crate) struct Store {
    folder: Arc<Folder>,
    root: PathBuf,
    arrays: Vec<(Variable, Array<Folder>)>,
}

/// The file of the group. It is written last: where it is, the metadata is complete.
const GROUP: &str = "zarr.json";
/// What differs in the metadata if only the program does.
const BUILD: [&str; 2] = ["version", "engine"];
/// Compression level: the default of gzip.
const LEVEL: u32 = 6;

impl Store {
    /// Opens the store of `plan` in a folder, or creates it. Axes may be long: `stop` ends it with an error.
    pub(crate) fn open(plan: &Plan, root: &Path, stop: &AtomicBool) -> Result<Self, StoreError> {
        let failed = |source| StoreError::Write { folder: root.into(), source };
        let folder = Arc::new(Folder::new(root));
        let arrays = variables(plan.settings())
            .map(|one| Ok((one, variable(plan, &folder, &one)?)))
            .collect::<Result<_, Box<dyn std::error::Error + Send + Sync>>>()
            .map_err(failed)?;
        let store = Self { folder, root: root.into(), arrays };
        match fs::read_to_string(root.join(GROUP)) {
            Ok(text) => store.check(plan, &text)?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                if !store.may_be_created(plan) {
                    return Err(StoreError::NotAStore(root.into()));
                }
                store.create(plan, stop).map_err(failed)?;
            }
            Err(error) => return Err(failed(error.into())),
        }
        Ok(store)
    }

    /// Opens the store of `plan` in a folder that must have it.
    pub(crate) fn existing(plan: &Plan, root: &Path) -> Result<Self, StoreError> {
        match root.join(GROUP).is_file() {
            true => Self::open(plan, root, &AtomicBool::new(false)),
            false => Err(StoreError::NotAStore(root.into())),
        }
    }

    /// Whether the folder has nothing, or what a program left that was killed before it wrote the group.
    fn may_be_created(&self, plan: &Plan) -> bool {
        let Ok(entries) = fs::read_dir(&self.root) else {
            return true;
        };
        let variables = self.arrays.iter().map(|(variable, _)| variable.name);
        let names: Vec<&str> = variables
            .chain(plan.coordinates().map(|(axis, ..)| axis.name.as_str()))
            .chain([PARTIAL])
            .collect();
        // A folder is made before the file that goes into it.
        let empty = |path: &Path| fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none());
        entries
            .flatten()
            .all(|entry| names.iter().any(|name| entry.file_name() == *name) || empty(&entry.path()))
    }

    fn create(&self, plan: &Plan, stop: &AtomicBool) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let mut metadata = Map::new();
        let mut note = |array: &Array<Folder>| -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
            array.store_metadata()?;
            let name = array.path().as_str().trim_start_matches('/').to_string();
            metadata.insert(name, serde_json::to_value(array.metadata())?);
            Ok(())
        };
        for (_, array) in &self.arrays {
            note(array)?;
        }
        for (axis, sequence, dimension) in plan.coordinates() {
            let (length, chunk) = (plan.shape[dimension], plan.chunk[dimension]);
            let attributes = json!({ "long_name": axis.name, "units": axis.unit() });
            let array = ArrayBuilder::new(vec![length], vec![chunk], data_type::float64(), f64::NAN)
                .bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(LEVEL)?)])
                .dimension_names(Some([plan.dimensions[dimension].as_str()]))
                .attributes(object(attributes))
                .build(self.folder.clone(), &format!("/{}", axis.name))?;
            note(&array)?;
            for n in 0..length.div_ceil(chunk) {
                if stop.load(Relaxed) {
                    return Err("stopped".into());
                }
                let value = |k| if k < length { sequence.at(k) } else { f64::NAN };
                let values: Vec<f64> = (n * chunk..(n + 1) * chunk).map(value).collect();
                array.store_chunk_opt(&[n], values, &options())?;
            }
        }
        let sampled: Vec<&str> = plan
            .coordinates()
            .filter(|(axis, ..)| axis.points().is_none())
            .map(|(axis, ..)| axis.name.as_str())
            .collect();
        let group = json!({
            "zarr_format": 3,
            "node_type": "group",
            "attributes": {
                "title": "Sweep of a linear oscillator with a vibro-impact nonlinear energy sink",
                "coordinates": sampled.join(" "),
                "vines": plan.description(),
            },
            "consolidated_metadata": { "kind": "inline", "must_understand": false, "metadata": metadata },
        });
        self.folder.write(GROUP, &serde_json::to_vec_pretty(&group)?)?;
        Ok(())
    }

    /// Compares the metadata of an existing store with the plan.
    fn check(&self, plan: &Plan, text: &str) -> Result<(), StoreError> {
        let Some(Value::Object(found)) = serde_json::from_str::<Value>(text)
            .ok()
            .and_then(|group| group.pointer("/attributes/vines").cloned())
        else {
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
            some if some.iter().all(|key| BUILD.contains(key)) => {
                let of = |from: &Map<String, Value>| {
                    let text = |key: &&str| from.get(*key).and_then(Value::as_str).unwrap_or("unknown").to_string();
                    BUILD.iter().map(text).collect::<Vec<_>>().join(" ")
                };
                Err(StoreError::Build { folder, found: of(&found), here: of(&here) })
            }
            some => {
                let differs = some.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
                Err(StoreError::Other { folder, differs })
            }
        }
    }

    /// Whether all variables of a chunk are there.
    pub(crate) fn has(&self, index: &[u64]) -> bool {
        let last = self.arrays.last();
        last.is_some_and(|(_, array)| self.folder.path(array.chunk_key(index).as_str()).exists())
    }

    /// Writes all variables of a chunk.
    pub(crate) fn write(&self, index: &[u64], cells: &[Cell]) -> Result<(), StoreError> {
        let options = options();
        let write = |(variable, array): &(Variable, Array<Folder>)| -> Result<(), ArrayError> {
            match variable.read {
                Read::Number(of) => array.store_chunk_opt(index, cells.iter().map(of).collect::<Vec<f64>>(), &options),
                Read::Count(of) => array.store_chunk_opt(index, cells.iter().map(of).collect::<Vec<u32>>(), &options),
                Read::Regime => array.store_chunk_opt(index, cells.iter().map(code).collect::<Vec<u8>>(), &options),
                Read::Failure => {
                    let reasons: Vec<&str> = cells.iter().map(|cell| cell.failure.as_str()).collect();
                    array.store_chunk_opt(index, reasons, &options)
                }
            }
        };
        self.arrays
            .iter()
            .try_for_each(write)
            .map_err(|error| self.failed(error))
    }

    /// Copies a chunk of another store of the same sweep.
    pub(crate) fn copy(&self, index: &[u64], from: &Self) -> Result<(), StoreError> {
        self.arrays.iter().try_for_each(|(_, array)| {
            let key = array.chunk_key(index);
            let content = fs::read(from.folder.path(key.as_str())).map_err(|error| from.failed(error))?;
            self.folder
                .write(key.as_str(), &content)
                .map_err(|error| self.failed(error))
        })
    }

    /// What was kept beside the arrays under this key.
    pub(crate) fn read(&self, key: &str) -> Option<Vec<u8>> {
        fs::read(self.folder.path(key)).ok()
    }

    /// Keeps something beside the arrays until the store is complete.
    pub(crate) fn keep(&self, key: &str, content: &[u8]) -> Result<(), StoreError> {
        self.folder.write(key, content).map_err(|error| self.failed(error))
    }

    fn failed(&self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> StoreError {
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

fn variable(
    plan: &Plan,
    folder: &Arc<Folder>,
    variable: &Variable,
) -> Result<Array<Folder>, Box<dyn std::error::Error + Send + Sync>> {
    let (data_type, fill): (DataType, ArrayBuilderFillValue) = match variable.read {
        Read::Number(_) => (data_type::float64(), f64::NAN.into()),
        Read::Count(_) => (data_type::uint32(), 0_u32.into()),
        Read::Regime => (data_type::uint8(), ABSENT.into()),
        Read::Failure => (data_type::string(), "".into()),
    };
    let mut attributes = json!({ "long_name": variable.meaning });
    if !variable.unit.is_empty() {
        attributes["units"] = variable.unit.into();
    }
    if let Read::Regime = variable.read {
        let names = Regime::SIMULATED
            .map(|regime| regime.name().replace(' ', "_"))
            .join(" ");
        attributes["flag_values"] = (0..Regime::SIMULATED.len()).collect::<Vec<_>>().into();
        attributes["flag_meanings"] = names.into();
    }
    Ok(
        ArrayBuilder::new(plan.shape.clone(), plan.chunk.clone(), data_type, fill)
            .bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(LEVEL)?)])
            .dimension_names(Some(plan.dimensions.iter().map(String::as_str)))
            .attributes(object(attributes))
            .build(folder.clone(), &format!("/{}", variable.name))?,
    )
}

/// Code of the regime of a cell.
pub(crate) fn code(cell: &Cell) -> u8 {
    let position = |regime| Regime::SIMULATED.iter().position(|one| *one == regime);
    cell.regime.and_then(position).map_or(ABSENT, |code| code as u8)
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
