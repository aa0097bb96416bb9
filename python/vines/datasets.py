"""Datasets with units."""

import json
from collections.abc import Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray


def dataset(variables: Mapping[str, tuple[Any, Any]], units: Mapping[str, str], **attributes: Any) -> "xarray.Dataset":
    """Return a dataset; units and variables have the same names."""
    module = _xarray()
    arrays = {
        name: (dimension, values, {"units": units[name]} if name in units else {})
        for name, (dimension, values) in variables.items()
    }
    found: xarray.Dataset = module.Dataset(
        arrays, attrs={name: _plain(value) for name, value in attributes.items() if value is not None}
    )
    return found


def opened(store: "str | PathLike[str]") -> "xarray.Dataset":
    """Return a store of a sweep, opened lazily; its attributes can be written to any format."""
    found: xarray.Dataset = _xarray().open_zarr(store)
    found.attrs = {name: _plain(value) for name, value in found.attrs.items()}
    return found


def _plain(value: Any) -> Any:
    """Return an attribute that netCDF has, too: no Boolean, no mapping."""
    if isinstance(value, bool):
        return int(value)
    return json.dumps(value) if isinstance(value, (dict, list)) else value


def _xarray() -> Any:
    try:
        import xarray
        import zarr  # noqa: F401
    except ImportError as error:
        raise ImportError(
            f"datasets need xarray and zarr, and {error.name} is missing: pip install xarray zarr, or "
            "pip install 'vines-testbench[all]'",
            name=error.name,
        ) from None
    return xarray
