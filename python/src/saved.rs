//! Plants and controllers as bytes, for `pickle` and `copy`.

use pyo3::{prelude::*, types::PyBytes};
use serde::{Serialize, de::DeserializeOwned};

use crate::scene::invalid;

const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The version of this package and a value, bit by bit.
pub fn save<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = postcard::to_stdvec(&(VERSION, value)).map_err(invalid)?;
    Ok(PyBytes::new(py, &bytes))
}

/// What [`save`] wrote.
pub fn restore<T: DeserializeOwned>(bytes: &[u8]) -> PyResult<T> {
    let damaged = |error| invalid(format!("these bytes are not what vines {VERSION} pickles: {error}"));
    let (version, rest) = postcard::take_from_bytes::<&str>(bytes).map_err(damaged)?;
    if version != VERSION {
        let message = format!("pickled with vines {version}, and this is {VERSION}; both must be the same");
        return Err(invalid(message));
    }
    match postcard::take_from_bytes(rest).map_err(damaged)? {
        (value, []) => Ok(value),
        (_, rest) => Err(invalid(format!("{} bytes too many in what was pickled", rest.len()))),
    }
}
