"""Files depend on each other without a circle, so that a reader begins at the bottom; a rig is a crate of its own."""

import re
import tomllib
from pathlib import Path

import pytest

from references import ROOT

RUST = r"^\s*(?:pub(?:\(crate\))? )?use crate::(?:\{\s*)?(\w+)|crate::(\w+)::"
SIBLING = r"^\s*(?:pub(?:\(crate\))? )?use super::(?:\{\s*)?(\w+)|super::(\w+)::"
SCRIPT = r"^import .* from \"\./(\w+)\.js\""


def imports(folder: Path, ending: str, pattern: str) -> dict[str, set[str]]:
    """The files of a folder that each file names; the modules in a folder belong to the file of its name."""
    files = {path.stem: path for path in folder.glob(f"*.{ending}")}
    arrows = {name: set() for name in files if name not in ("lib", "main")}
    for name in arrows:
        for part in [files[name], *(folder / name).rglob(f"*.{ending}")]:
            text = re.sub(r"^#\[cfg\(test\)\].*", "", part.read_text(), flags=re.DOTALL | re.MULTILINE)
            found = re.findall(pattern, text, re.MULTILINE)
            words = {word for match in found for word in ([match] if isinstance(match, str) else match)}
            arrows[name] |= words & arrows.keys() - {name}
    return arrows


def circle(arrows: dict[str, set[str]]) -> set[str]:
    """The files left when those that depend on no other one have been taken away, again and again."""
    left = dict(arrows)
    while free := [name for name, to in left.items() if not to & left.keys()]:
        for name in free:
            del left[name]
    return set(left)


@pytest.mark.parametrize(
    ("folder", "ending", "pattern"),
    [
        ("src", "rs", RUST),
        ("controller/src", "rs", RUST),
        ("lab/bench/src", "rs", RUST),
        ("lab/scene/src", "rs", RUST),
        ("lab/model/src", "rs", RUST),
        ("lab/model/src/orbit", "rs", SIBLING),
        ("lab/page", "js", SCRIPT),
    ],
)
def test_no_file_depends_on_one_that_depends_on_it(folder, ending, pattern):
    arrows = imports(ROOT / folder, ending, pattern)
    assert sum(map(len, arrows.values())) > len(arrows)
    assert circle(arrows) == set()


def test_a_rig_is_a_crate_that_knows_nothing_of_the_lab_but_what_a_rig_is():
    ours = {tomllib.loads(path.read_text())["package"]["name"] for path in ROOT.glob("lab/**/Cargo.toml")}
    for path in ROOT.glob("rigs/*/Cargo.toml"):
        assert ours & set(tomllib.loads(path.read_text())["dependencies"]) == {"vines-rig"}, path
