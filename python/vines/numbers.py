"""Numbers of any library: Python, NumPy, xarray, decimal and others."""

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def scalar(value: Any) -> Any:
    """Return the value of a 0-d array or of a NumPy scalar as an object of Python; other values as they are."""
    _unmasked(value)
    # NumPy makes whole numbers of dates.
    date = getattr(getattr(value, "dtype", None), "kind", "") in ("m", "M")
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item") and not date:
        value = value.item()
    return value


def real(value: Any) -> float:
    """Return a real number as a float; a text, a Boolean or a complex number is a `TypeError`.

    Examples
    --------
    >>> import numpy as np
    >>> real(np.asarray(1.5))
    1.5
    """
    value = scalar(value)
    if isinstance(value, np.longdouble):
        return float(value)
    number = hasattr(value, "__float__") or hasattr(value, "__index__")
    if isinstance(value, (bool, str, bytes, complex)) or hasattr(value, "ndim") or not number:
        raise TypeError(f"{value!r} of type {type(value).__name__}: a real number is allowed")
    return float(value)


def reals(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """Return an array of real numbers; another type is a `ValueError` that names it."""
    _unmasked(given)
    values = np.asarray(given)
    if values.dtype.kind == "O" and values.size:
        # Decimals, fractions, and scalars of other libraries.
        with suppress(TypeError, ValueError):
            values = np.array([real(one) for one in values.flat]).reshape(values.shape)
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{name} of type {values.dtype}: real numbers are allowed")
    return values.astype(np.float64, copy=False)


def _unmasked(value: Any) -> None:
    # Conversions drop the mask, and compute with what is under it.
    parts = value if isinstance(value, (list, tuple)) else (value,)
    if any(isinstance(one, np.ma.MaskedArray) and np.ma.is_masked(one) for one in parts):
        raise ValueError(f"{value!r} has masked values: fill them, or leave them out")
