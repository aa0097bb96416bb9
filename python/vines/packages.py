"""Packages that only some formats of files need."""

import importlib
from typing import Any

_NEEDED = {
    "pymatreader": "MAT",
    "h5py": "HDF5",
    "xarray": "HDF5 with missing values, scales or times",
    "nptdms": "TDMS",
    "pyuff": "UFF",
    "lvm_read": "LVM",
    "pandas": "a table with dates or times",
}


def package(name: str) -> Any:
    """Return a package, or raise an `ImportError` that says what needs it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{_NEEDED[name]} needs the package {name}: pip install './python[io]'") from error
