//! Numbers from Python.

use std::marker::PhantomData;

use pyo3::{prelude::*, sync::PyOnceLock, types::PyFloat};

/// The unit of an argument: a number that carries another one is converted, or refused.
pub trait Unit {
    const SYMBOL: &'static str;
}

macro_rules! units {
    ($($name:ident = $symbol:literal;)+) => {
        $(
            #[derive(Clone, Copy)]
            pub struct $name;

            impl Unit for $name {
                const SYMBOL: &'static str = $symbol;
            }
        )+
    };
}

units! {
    One = "1";
    Metre = "m";
    Second = "s";
    RadPerSecond = "rad/s";
}

/// A real number: a float, or what `vines.numbers.real` makes one of.
#[derive(Clone, Copy)]
pub struct Real<U = One>(pub f64, PhantomData<U>);

impl<'py, U: Unit> FromPyObject<'_, 'py> for Real<U> {
    type Error = PyErr;

    #[inline]
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let value = match given.cast::<PyFloat>() {
            Ok(float) => float.value(),
            Err(_) => convert(given, U::SYMBOL)?,
        };
        Ok(Self(value, PhantomData))
    }
}

#[cold]
fn convert(given: Borrowed<'_, '_, PyAny>, unit: &str) -> PyResult<f64> {
    static REAL: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let real = REAL.import(given.py(), "vines.numbers", "real")?;
    real.call1((given, unit))?.extract()
}
