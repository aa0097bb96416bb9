//! Numbers from Python.

use pyo3::{prelude::*, sync::PyOnceLock, types::PyFloat};

/// A real number: a float, or what `vines.numbers.real` makes one of.
#[derive(Clone, Copy)]
pub struct Real(pub f64);

impl<'py> FromPyObject<'_, 'py> for Real {
    type Error = PyErr;

    #[inline]
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match given.cast::<PyFloat>() {
            Ok(float) => Ok(Self(float.value())),
            Err(_) => convert(given),
        }
    }
}

#[cold]
fn convert(given: Borrowed<'_, '_, PyAny>) -> PyResult<Real> {
    static REAL: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let real = REAL.import(given.py(), "vines.numbers", "real")?;
    real.call1((given,))?.extract().map(Real)
}
