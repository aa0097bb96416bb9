"""Compares the results of two programs, in two folders: all texts are equal, and numbers to their last digits.

Called by scripts/windows; needs the standard library only. The largest relative difference of each file is printed.
"""

import re
import sys
from pathlib import Path

# Functions such as exp are those of the system, and differ in the last bit. A difference of results, such as
# sigma_less_exact, is 1e-6 of them and keeps five digits.
MOST = 1e-5
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def difference(one: str, other: str) -> float | None:
    """Largest relative difference of numbers; nothing where the texts between them differ."""
    if NUMBER.sub("#", one) != NUMBER.sub("#", other):
        return None
    pairs = [(float(a), float(b)) for a, b in zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)]
    return max((abs(a - b) / max(abs(a), abs(b)) for a, b in pairs if a != b), default=0.0)


here, there = map(Path, sys.argv[1:])
names = sorted(path.relative_to(here) for path in here.rglob("*") if path.is_file())
if names != sorted(path.relative_to(there) for path in there.rglob("*") if path.is_file()):
    sys.exit("the programs write different files")
for name in names:
    # FMUs hold libraries of their system, and messages tell how fast it is.
    if name.suffix in (".fmu", ".ssp") or name.name == "messages":
        continue
    one, other = ((folder / name).read_text(encoding="utf-8") for folder in (here, there))
    # Where files are named, and in the report the system.
    other = other.replace("\\", "/").replace(" on windows", " on linux")
    largest = difference(one, other)
    if largest is None:
        sys.exit(f"{name}: the text differs")
    if largest > MOST:
        sys.exit(f"{name}: numbers differ by {largest:.1e}")
    print(f"{name}: {'equal' if one == other else f'equal but for numbers, by at most {largest:.1e}'}")
