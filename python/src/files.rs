//! Files: plain tables, what Python has read, and the command line of `vines fit`.

use std::{
    ffi::OsString,
    path::Path,
    sync::{Arc, atomic::AtomicBool},
};

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::{prelude::*, types::PyBytes};
use vines::{
    ArgumentError,
    cli::{self, Source},
    fit::{Channel, Contents, plain_table},
    scene, unit,
};

use crate::{scene::invalid, wait::wait_apart};

/// Samples of a channel, and its cells if some are no numbers.
type Values<'py> = (Bound<'py, PyArray1<f64>>, Vec<String>);
/// A channel: name, unit, samples, cells, and start and step (s) of a clock of its own.
type ChannelTuple<'py> = (
    String,
    String,
    PyReadonlyArray1<'py, f64>,
    Vec<String>,
    Option<[f64; 2]>,
);
/// What a file contains: how it was read, line of the first sample, channels, and what is no channel with its reason.
pub type ContentsTuple<'py> = (String, usize, Vec<ChannelTuple<'py>>, Vec<[String; 2]>);

pub fn contents_of(path: &str, (layout, first_line, channels, refused): ContentsTuple<'_>) -> Contents {
    let channel = |(name, unit, values, texts, clock): ChannelTuple<'_>| Channel {
        name,
        unit,
        values: values.as_array().to_vec(),
        texts,
        clock,
    };
    Contents {
        origin: path.into(),
        layout,
        first_line,
        channels: channels.into_iter().map(channel).collect(),
        refused,
        ..Contents::default()
    }
}

/// A plain table as text: how it was read, line of the first row, and its columns. A `ValueError` for any other file.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn table<'py>(
    py: Python<'py>,
    path: &str,
    content: &[u8],
) -> PyResult<(String, usize, Vec<(String, String, Values<'py>)>)> {
    let Contents { layout, first_line, channels, .. } = py.detach(|| plain_table(path, content)).map_err(invalid)?;
    let column = |Channel { name, unit, values, texts, .. }| (name, unit, (values.into_pyarray(py), texts));
    Ok((layout, first_line, channels.into_iter().map(column).collect()))
}

/// The text of a file in UTF-8; a `ValueError` for another encoding.
#[pyfunction]
pub fn utf8(path: &str, content: &[u8]) -> PyResult<String> {
    let text = scene::utf8(content).map_err(|error| invalid(format!("{path}: {error}")))?;
    Ok(text.into())
}

/// SI units per unit and the SI unit of a unit, or `None`.
#[pyfunction]
pub fn si(unit: &str) -> Option<(f64, &'static str)> {
    unit::parse(unit, "").filter(|(_, si)| !si.is_empty())
}

/// Whether a text is a unit of a table, also one that says nothing of a motion.
#[pyfunction]
pub fn is_unit(text: &str) -> bool {
    unit::is_unit(text)
}

/// A Boolean by its words in a table, or `None`.
#[pyfunction]
pub fn truth(word: &str) -> Option<bool> {
    cli::truth(word)
}

/// `vines fit` with the words of a command line: its exit code, and what it prints on standard output and error. `read` returns the contents of a
/// file, or JSON as bytes.
#[pyfunction]
pub fn command_line(py: Python<'_>, words: Vec<OsString>, read: Py<PyAny>) -> PyResult<(u8, String, String)> {
    let source = move |path: &Path| -> Result<Source, ArgumentError> {
        Python::attach(|py| -> PyResult<Source> {
            let found = read.bind(py).call1((path,))?;
            if let Ok(json) = found.cast::<PyBytes>() {
                return Ok(Source::Json(json.as_bytes().into()));
            }
            Ok(Source::Channels(contents_of(
                &path.display().to_string(),
                found.extract()?,
            )))
        })
        .map_err(|error| Python::attach(|py| error.value(py).to_string()).into())
    };
    let stop = Arc::new(AtomicBool::new(false));
    let printed = wait_apart(py, &stop, move || cli::fit(&words, &source))?;
    Ok((printed.code, printed.out, printed.err))
}
