"""Datasets with units."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray


def dataset(variables: Mapping[str, tuple[Any, Any]], units: Mapping[str, str], **attributes: Any) -> "xarray.Dataset":
    """Return a dataset; units and variables have the same names."""
    import xarray

    arrays = {
        name: (dimension, values, {"units": units[name]} if name in units else {})
        for name, (dimension, values) in variables.items()
    }
    return xarray.Dataset(arrays, attrs=attributes)
