"""Numbers of any library: Python, NumPy, xarray, pandas, decimal and others, with their units and their masks.

Every function of the package takes its numbers by `real` or `reals`. A number that carries a unit (a quantity of pint,
astropy or unyt, a column of a table with one, an array with the attribute `units`) is converted to the unit of the
argument, or refused. Masked and missing numbers are refused, or NaN where the caller allows them.
"""

import re
import unicodedata
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native

_LONG = {"m": "meter metre", "s": "second sec", "min": "minute", "N": "newton", "V": "volt", "rad": "radian"}
_PREFIXES = {"": "", "milli": "m", "micro": "u", "nano": "n", "centi": "c", "kilo": "k"}
#: Units in words, in small letters, and their symbols.
_WORDS = {
    f"{prefix}{word}{plural}": f"{short}{symbol}"
    for symbol, words in _LONG.items()
    for word in words.split()
    for prefix, short in _PREFIXES.items()
    for plural in ("", "s")
} | {
    **dict.fromkeys(("micron", "microns"), "um"),
    **dict.fromkeys(("msec", "msecs"), "ms"),
    **dict.fromkeys(("usec", "usecs"), "us"),
    **dict.fromkeys(("degree", "degrees"), "deg"),
    **dict.fromkeys(("hertz",), "Hz"),
    **dict.fromkeys(("kilogram", "kilograms"), "kg"),
    **dict.fromkeys(("standard_gravity", "g_n", "gn"), "g"),
}
_TOKEN = re.compile(r"\s*(/?)\s*([^\W\d]+|1)\s*\^?\s*([+-]?\d+)?")
#: Units of scenes that no channel of a recording has.
_OTHERS = ("kg", "N/m", "N s/m", "1/s")
#: Attributes of netCDF that change the values.
_CODED = ("scale_factor", "add_offset", "_FillValue", "missing_value")
_NONE = ("", "1", "-", "none", "dimensionless")


def symbol(text: str) -> str:
    """Return a unit as scenes and tables write it; one that they do not know as it is.

    Examples
    --------
    >>> [symbol(one) for one in ("millimeter / second", "mm s-1", "m·s⁻²", "Volt", "newton * second / meter", "mil")]
    ['mm/s', 'mm/s', 'm/s²', 'V', 'N s/m', 'mil']
    """
    written = text.strip()
    if written.lower() in _NONE:
        return "1"
    if _native.si(written) is not None or written in _OTHERS:
        return written
    # Digits instead of superscripts.
    plain = unicodedata.normalize("NFKC", written).replace("\u2212", "-").replace("**", "^").replace(" per ", "/")
    plain = re.sub(r"[*.\u00b7\u22c5]", " ", re.sub(r"\(([^()\s*/]+)\)", r"\1", plain))
    powers: dict[str, int] = {}
    at = 0
    while at < len(plain):
        found = _TOKEN.match(plain, at)
        if found is None:
            return written
        slash, name, power = found.groups()
        name = _WORDS.get(name.lower(), name)
        powers[name] = powers.get(name, 0) + int(power or 1) * (-1 if slash else 1)
        at = found.end()
    powers.pop("1", None)
    above = [name for name, power in powers.items() if power == 1]
    below = [(name, -power) for name, power in powers.items() if power < 0]
    if len(above) + len(below) < len(powers) or len(below) > 1:
        return written
    ends = {1: "", 2: "\u00b2"}
    if any(power not in ends for _, power in below):
        return written
    candidate = "/".join([" ".join(above) or "1", *(f"{name}{ends[power]}" for name, power in below)])
    return candidate if _native.si(candidate) is not None or candidate in _OTHERS else written


def factor(unit: str, allowed: str) -> float | None:
    """Return how many of the allowed unit one of a unit is; None if it measures something else, or is not known."""
    one, two = symbol(unit), symbol(allowed)
    if one == two:
        return 1.0
    found, wanted = _native.si(one), _native.si(two)
    return found[0] / wanted[0] if found is not None and wanted is not None and found[1] == wanted[1] else None


def stated(value: Any) -> str | None:
    """Return the unit that a number or an array carries; None without one."""
    # A DataArray around a quantity.
    inner: Any = getattr(value, "data", None) if hasattr(value, "dims") else None
    attributes = getattr(value, "attrs", None)
    of_attributes = attributes if isinstance(attributes, Mapping) else {}
    for holder in (inner, value):
        for key in ("units", "unit"):
            found = getattr(holder, key, None)
            found = of_attributes.get(key) if found is None else found
            if found is not None and not callable(found) and str(found).strip():
                return found.decode() if isinstance(found, bytes) else str(found)
    return None


def _magnitude(value: Any) -> Any:
    """Return a number or an array without its unit; a mask stays."""
    inner: Any = getattr(value, "data", None) if hasattr(value, "dims") else None
    for holder in (inner, value):
        if isinstance(holder, np.ma.MaskedArray):
            return np.ma.MaskedArray(np.ma.getdata(holder).view(np.ndarray), np.ma.getmaskarray(holder))
        if hasattr(holder, "magnitude"):
            return holder.magnitude
        if (hasattr(holder, "unit") or hasattr(holder, "units")) and hasattr(holder, "value"):
            return holder.value
    return np.asarray(value)


def _plain(name: str, value: Any, unit: str) -> tuple[Any, float]:
    """Return a number or an array without its unit, and the factor to the allowed unit."""
    attributes = getattr(value, "attrs", None)
    coded = [key for key in _CODED if isinstance(attributes, Mapping) and key in attributes]
    if coded:
        raise ValueError(f"{name} has the attributes {', '.join(coded)}: decode it with xarray.decode_cf")
    written = stated(value)
    if written is None:
        return value, 1.0
    found = factor(written, unit)
    if found is None:
        allowed = "a number without a unit" if symbol(unit) == "1" else f"{unit}, or a number without a unit,"
        first = f"{name} = " if name else ""
        short = " ".join(str(value).split())[:80]
        raise ValueError(f"{first}{short} has the unit {written}: {allowed} is allowed")
    return _magnitude(value), found


def scalar(value: Any) -> Any:
    """Return the value of a 0-d array or of a NumPy scalar as an object of Python; other values as they are."""
    _unmasked(value)
    # NumPy makes whole numbers of dates.
    date = getattr(getattr(value, "dtype", None), "kind", "") in ("m", "M")
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item") and not date:
        value = value.item()
    return value


def real(value: Any, unit: str = "1", name: str = "") -> float:
    """Return a real number as a float, in a unit; a text, a Boolean or a complex number is a `TypeError`.

    Examples
    --------
    >>> import numpy as np
    >>> real(np.asarray(1.5))
    1.5
    """
    value, of_unit = _plain(name, value, unit)
    value = scalar(value)
    if isinstance(value, np.longdouble):
        return float(value) * of_unit
    number = hasattr(value, "__float__") or hasattr(value, "__index__")
    if isinstance(value, (bool, str, bytes, complex)) or hasattr(value, "ndim") or not number:
        raise TypeError(f"{value!r} of type {type(value).__name__}: a real number is allowed")
    return float(value) * of_unit


def reals(name: str, given: ArrayLike, unit: str = "1", *, missing: bool = False) -> NDArray[np.float64]:
    """Return an array of real numbers in a unit; another type is a `ValueError` that names it.

    Masked and absent numbers are NaN if `missing`, and otherwise a `ValueError`.
    """
    if isinstance(given, (list, tuple)) and not all(isinstance(one, (int, float)) for one in given):
        try:
            return np.array([reals(name, one, unit, missing=missing) for one in given], dtype=np.float64)
        except ValueError as error:
            if "inhomogeneous" in str(error):
                raise ValueError(f"{name}: rows of different lengths; an array of numbers is allowed") from None
            raise
    value, of_unit = _plain(name, given, unit)
    mask = _mask(value)
    if not missing:
        _unmasked(value)
    values = np.asarray(value.unmasked if hasattr(value, "unmasked") else np.ma.getdata(value))
    if values.dtype.kind == "O":
        # Decimals, fractions, and scalars of other libraries.
        with suppress(TypeError):
            each = (np.nan if missing and _is_absent(one) else real(one, unit, name) for one in values.flat)
            values = np.array([*each], dtype=np.float64).reshape(values.shape)
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{name} of type {values.dtype}: real numbers are allowed")
    found = values.astype(np.float64, copy=False) * of_unit if of_unit != 1.0 else values.astype(np.float64, copy=False)
    return found if mask is None else np.where(mask, np.nan, found)


def _mask(value: Any) -> Any:
    """Return where the numbers are masked; None if nothing is."""
    mask = np.ma.getmaskarray(value) if isinstance(value, np.ma.MaskedArray) else None
    if hasattr(value, "unmasked"):
        mask = np.asarray(value.mask)
    return mask if mask is not None and mask.any() else None


def _is_absent(value: Any) -> bool:
    return value is None or type(value).__name__ in ("NAType", "NaTType", "MaskedConstant")


def _unmasked(value: Any) -> None:
    # Conversions drop the mask, and compute with what is under it.
    parts = value if isinstance(value, (list, tuple)) else (value,)
    if any(_mask(one) is not None for one in parts):
        raise ValueError(f"{value!r} has masked values: fill them, or leave them out")
