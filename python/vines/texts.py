"""Tables of text as other programs write them. The compiled part reads plain ones; here are the other dialects.

A table may have any encoding, comments, lines above the names, a row of units, a decimal comma, marks between
thousands, exponents of Fortran, units and times in its cells, and a last row that is cut off. The layout is the one
that reads the largest share of the cells as numbers; two that read them equally well as different numbers are refused.
"""

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from .numbers import symbol
from .packages import package

#: Delimiters and decimal marks. Of two that read a table equally well, and as the same numbers, it is the first.
_LAYOUTS = tuple((delimiter, mark) for delimiter in ",;\t |" for mark in ".,")
#: Number of rows, at the end of the table, by which the layout is found.
_JUDGED = 200
#: Cells that say that a number is missing.
_ABSENT = frozenset(("", "nan", "na", "n/a", "#n/a", "#nv", "null", "none"))
#: Marks between thousands that cannot be decimal marks: apostrophes and narrow or fixed spaces.
_SPACES = "'\u2019\u00a0\u202f"
_TIME = re.compile(r"[\d.,/TZ :+-]*\d:\d\d[\d.,TZ :+-]*([AaPp][Mm])?")

#: A column: name, unit, numbers, and its cells if some are neither numbers nor empty.
Column = tuple[str, str, NDArray[np.float64], list[str]]


@dataclass(frozen=True)
class Mark:
    """What a number looks like with a decimal mark."""

    mark: str

    def __post_init__(self) -> None:
        other = "." if self.mark == "," else ","
        thousands = rf"[1-9]\d{{0,2}}(?P<mark>[{other}{_SPACES}])\d{{3}}(?:(?P=mark)\d{{3}})*"
        mark = re.escape(self.mark)
        digits = rf"(?:(?:{thousands}|\d+)(?:{mark}\d*)?|{mark}\d+)(?:[eEdDqQ][+-]?\d+)?"
        # Fortran writes 1.0D-03, and 1.0-103 without a letter.
        number = rf"[+-]?(?:{digits}|\d*{mark}\d+[+-]\d{{3}}|inf(?:inity)?)"
        pattern = re.compile(rf"(?P<number>{number})(?:\s*(?P<unit>[^\W\d]\S*))?")
        object.__setattr__(self, "_pattern", pattern)
        object.__setattr__(self, "_marks", str.maketrans(dict.fromkeys(other + _SPACES) | {self.mark: "."}))

    def number(self, cell: str) -> tuple[float, str] | None:
        """Return a number and the unit behind it; None for other texts."""
        if cell.lower() in _ABSENT:
            return np.nan, ""
        # The minus sign of typography.
        found = self._pattern.fullmatch(cell.replace("\u2212", "-"))  # type: ignore[attr-defined]
        if found is None or (found["unit"] and not _native.is_unit(symbol(found["unit"]))):
            return None
        text = re.sub("[dDqQ]", "e", found["number"].translate(self._marks))  # type: ignore[attr-defined]
        text = re.sub(r"(?<=[\d.])([+-]\d{3})$", r"e\1", text)
        return float(text), found["unit"] or ""

    def reads(self, cell: str) -> bool:
        """Return whether a cell is a number, empty, or a time."""
        return self.number(cell) is not None or _TIME.fullmatch(cell) is not None


def decoded(content: bytes) -> str:
    """Return the text of a file: UTF-8, UTF-16 or Latin-1 (Windows)."""
    for start, encoding in ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if content.startswith(start):
            return content.decode(encoding, errors="replace")
    # Every second byte of UTF-16 is 0 in a table of numbers.
    begin = content[:400]
    zeros = [begin[n::2].count(0) for n in (0, 1)]
    if 2 * max(zeros) > len(begin) // 2:
        return content.decode("utf-16-le" if zeros[1] > zeros[0] else "utf-16-be", errors="replace")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def table(origin: str, content: bytes) -> tuple[str, int, list[Column]]:
    """Read a table: how it was read, the line of its first row, and its columns."""
    text = decoded(content)
    lines = [*_without_comments(text)]
    if not "".join(lines).strip():
        raise ValueError(f"{origin} is empty: it has no row of numbers")
    delimiter, mark = _layout(origin, lines)
    read = Mark(mark)
    rows = _rows(lines, delimiter)
    width = Counter(len(row) for _, row in rows[-_JUDGED:]).most_common(1)[0][0]
    tail = [row for _, row in rows[-_JUDGED:] if len(row) == width]
    numeric = [2 * sum(read.reads(row[n]) for row in tail) > len(tail) for n in range(width)]

    def is_data(row: Sequence[str]) -> bool:
        return len(row) == width and all(read.reads(row[n]) or not numeric[n] for n in range(width))

    first = next((n for n in range(len(rows) - 1) if is_data(rows[n][1]) and is_data(rows[n + 1][1])), None)
    if first is None:
        raise ValueError(f"{origin} has no two rows of numbers in sequence")
    names, units = _header(origin, rows[:first], width, read)
    about = {"\t": "tab", " ": "space"}.get(delimiter, f"`{delimiter}`")
    layout = f"delimiter {about}, decimal mark `{mark}`"
    if len(rows[-1][1]) < width:
        rows.pop()
        layout += ", the last row is cut off and left out"
    for line, row in rows[first:]:
        if len(row) != width:
            raise ValueError(
                f"{origin}, row {line}: it has {len(row)} values, and the table {width} columns ({layout}); repair the "
                "row, or cut the file there"
            )
    cells = [*zip(*(row for _, row in rows[first:]), strict=True)]
    columns = [
        (name, *_column(unit, column, read, numeric[n]))
        for n, (name, unit, column) in enumerate(zip(names, units, cells, strict=True))
    ]
    return layout, rows[first][0], columns


def _without_comments(text: str) -> Iterator[str]:
    """Return the lines, empty for comments. Those at the beginning may be the names: they lose only their sign."""
    beginning = True
    for line in text.splitlines():
        found = re.match(r"\s*(#|%|//)\s*(.*)", line)
        beginning = beginning and (found is not None or not line.strip())
        yield line if found is None else found[2] if beginning else ""


def _rows(lines: Sequence[str], delimiter: str) -> list[tuple[int, list[str]]]:
    """Return the rows that are not empty, with their lines."""
    if delimiter == " ":
        return [(n, line.split()) for n, line in enumerate(lines, 1) if line.strip()]
    reader = csv.reader(io.StringIO("\n".join(lines).replace("\0", "")), delimiter=delimiter, skipinitialspace=True)
    return [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(cell.strip() for cell in row)]


def _layout(origin: str, lines: Sequence[str]) -> tuple[str, str]:
    """Return delimiter and decimal mark."""
    kept = [line for line in lines if line.strip()][-_JUDGED - 1 :]
    # The last row may be cut off.
    kept = kept[:-1] if len(kept) > 3 else kept
    judged = []
    for delimiter, mark in _LAYOUTS:
        rows, read = [row for _, row in _rows(kept, delimiter)], Mark(mark)
        width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
        cells = [cell for row in rows if len(row) == width for cell in row]
        numbers = sum(map(read.reads, cells))
        has_number = any(read.reads(cell) and cell.lower() not in _ABSENT for cell in cells)
        if has_number:
            judged.append((numbers / max(1, sum(map(len, rows))), width, delimiter, mark, cells))
    if not judged:
        begin = "".join(f"\n  {line[:100]}" for line in [line for line in lines if line.strip()][:3])
        raise ValueError(f"{origin} has no table of numbers. It begins with{begin}")
    best = max(judged, key=lambda one: one[:2])
    *_, delimiter, mark, cells = next(one for one in judged if one[:2] == best[:2])
    for *rank, other_delimiter, other, _ in judged:
        if tuple(rank) == best[:2] and other_delimiter == delimiter and other != mark:
            for cell in cells:
                one, two = Mark(mark).number(cell), Mark(other).number(cell)
                if one != two and one is not None and two is not None and not np.isnan(one[0]):
                    raise ValueError(
                        f"{origin}: `{cell}` may be {one[0]:.15g} or {two[0]:.15g}, and no other cell tells which; "
                        "write a number with another number of decimals"
                    )
    return delimiter, mark


def _header(origin: str, above: Sequence[tuple[int, list[str]]], width: int, read: Mark) -> tuple[list[str], list[str]]:
    """Return names and units from the rows above the first row of numbers."""

    def is_row(row: Sequence[str]) -> bool:
        return len(row) == width or (len(row) == width + 1 and not row[-1])

    def are_units(row: Sequence[str]) -> bool:
        given = [cell for cell in row if cell]
        return bool(given) and all(_native.is_unit(symbol(cell.strip("[]()"))) for cell in given)

    def numbers(row: Sequence[str]) -> int:
        return sum(read.reads(cell) for cell in row if cell)

    rows = list(above)
    units, has_units = [""] * width, False
    if rows and is_row(rows[-1][1]) and are_units(rows[-1][1]) and len(rows) > 1 and is_row(rows[-2][1]):
        units, has_units = rows.pop()[1][:width], True
    numbered = [str(n) for n in range(1, width + 1)]
    if not rows:
        return numbered, units
    line, row = rows[-1]
    has_names = is_row(row)
    # Names may be numbers, in the first row or above a row of units.
    if 2 * numbers(row) > len(row) > 1 and not (has_names and (has_units or len(rows) == 1)):
        raise ValueError(
            f"{origin}, row {line}: it has {len(row)} values, {', '.join(row)}, and the rows below are {width} "
            "numbers; repair the row, or delete it"
        )
    if not has_names:
        return numbered, units
    split = [_split(name) for name in row[:width]]
    return [name for name, _ in split], [unit or one for (_, unit), one in zip(split, units, strict=True)]


def _split(name: str) -> tuple[str, str]:
    """Return a name and its unit, from `y [mm]` or `y (mm)`."""
    for pattern in (r"(.*\S)\s*\[([^\[\]]*)\]", r"(.*\S)\s*\(([^()]*(?:\([^()]*\))?[^()]*)\)"):
        found = re.fullmatch(pattern, name.strip())
        if found and _native.is_unit(symbol(found[2])):
            return found[1].strip(), found[2].strip()
    return name.strip(), ""


def _column(unit: str, cells: Sequence[str], read: Mark, numeric: bool) -> tuple[str, NDArray[np.float64], list[str]]:
    """Return unit, numbers, and the cells if some are neither numbers nor empty."""
    unit = symbol(unit.strip("[]()")) if unit.strip("[]()") else ""
    if numeric and any(":" in cell for cell in cells):
        times = _times(cells)
        return ("s", times, []) if times is not None else (unit, np.full(len(cells), np.nan), [*cells])
    found = [read.number(cell) for cell in cells]
    values = np.array([np.nan if one is None else one[0] for one in found])
    units = {symbol(one[1]) for one in found if one is not None and one[1]}
    if units:
        # Each cell has its unit, which may change with the size of the number.
        known = {one: _native.si(one) for one in units}
        kinds = {None if one is None else one[1] for one in known.values()}
        if len(kinds) == 1 and None not in kinds:
            factors = [1.0 if one is None or not one[1] else known[symbol(one[1])][0] for one in found]  # type: ignore[index]
            return str(kinds.pop()), values * factors, [] if None not in found else [*cells]
        return unit, np.full(len(cells), np.nan), [*cells]
    return unit, values, [] if None not in found else [*cells]


def _times(cells: Sequence[str]) -> NDArray[np.float64] | None:
    """Return times of the day, durations or dates in seconds; dates from the first one."""
    pandas: Any = package("pandas")
    texts = [re.sub(r"(:\d\d),(\d)", r"\1.\2", cell) for cell in cells]
    try:
        if all(re.fullmatch(r"\d+:\d\d:\d\d(\.\d*)?|", cell) for cell in texts):
            return np.asarray(pandas.to_timedelta(texts) / pandas.Timedelta(1, "s"), dtype=np.float64)
        days_first = any(re.match(r"\d{1,2}\.|(1[3-9]|[23]\d)/", cell) for cell in texts)
        dates = pandas.to_datetime(texts, format="mixed", dayfirst=days_first, utc=True)
        return np.asarray((dates - dates[0]) / pandas.Timedelta(1, "s"), dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        return None
