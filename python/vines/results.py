"""What all results have in common."""

from dataclasses import fields, is_dataclass
from html import escape
from typing import Any

import numpy as np


class Result:
    """A result: it compares equal if all its numbers are, and shows itself in a few lines."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(same(one, two) for (_, one), (_, two) in zip(self._parts(), other._parts(), strict=True))

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {', '.join(f'{name} = {text}' for name, text in self._summary())}>"

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in self._summary())
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"

    def _parts(self) -> list[tuple[str, Any]]:
        assert is_dataclass(self)
        return [(field.name, getattr(self, field.name)) for field in fields(self)]

    def _summary(self) -> list[tuple[str, str]]:
        return [(name, brief(value)) for name, value in self._parts()]


def brief(value: Any) -> str:
    """Return a value in a few words: a number with six digits, an array or a table with its size."""
    match value:
        case bool() | None:
            return str(value)
        case float():
            return f"{value:.6g}"
        case np.ndarray():
            return f"{value.size} values"
        case dict() if all(isinstance(one, np.ndarray) for one in value.values()):
            return f"{len(next(iter(value.values()), ()))} rows of {', '.join(value)}"
        case dict():
            numbers = [f"{name} {brief(one)}" for name, one in value.items() if isinstance(one, (float, str))]
            return "{" + ", ".join(numbers[:6]) + (", ...}" if len(numbers) > 6 else "}")
        case tuple() | list():
            return f"({', '.join(brief(one) for one in value)})"
        case _:
            return str(value)


def same(one: Any, two: Any) -> bool:
    """Return whether two values are equal, number by number; NaN equals NaN."""
    if isinstance(one, dict) and isinstance(two, dict):
        return one.keys() == two.keys() and all(same(one[key], two[key]) for key in one)
    if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
        one, two = np.asarray(one), np.asarray(two)
        numbers = one.dtype.kind == "f" and two.dtype.kind == "f"
        return bool(np.array_equal(one, two, equal_nan=numbers))
    return bool(one == two or (one != one and two != two))


def axes(given: Any) -> Any:
    """Return the axes of matplotlib to draw into: those given, or new ones."""
    if given is not None:
        return given
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]
