"""Datasets with units."""

import importlib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray


def dataset(variables: Mapping[str, tuple[Any, Any]], units: Mapping[str, str], **attributes: Any) -> "xarray.Dataset":
    """Return a dataset; units and variables have the same names."""
    module = needed("xarray")
    arrays = {
        name: (dimension, values, {"units": units[name]} if name in units else {})
        for name, (dimension, values) in variables.items()
    }
    found: xarray.Dataset = module.Dataset(
        arrays, attrs={name: _plain(value) for name, value in attributes.items() if value is not None}
    )
    return found


def _plain(value: Any) -> Any:
    """Return an attribute that netCDF has, too: no Boolean, no mapping."""
    if isinstance(value, bool):
        return int(value)
    return json.dumps(value) if isinstance(value, (dict, list)) else value


def needed(name: str) -> Any:
    """Return a module that results as datasets, or stores of sweeps, need."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(
            f"datasets need xarray and stores zarr, and {error.name} is missing: pip install xarray zarr, or "
            "pip install 'vines-testbench[all]'",
            name=error.name,
        ) from None
