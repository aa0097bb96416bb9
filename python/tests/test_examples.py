"""The examples run and write their figures, in the style of the program; each is a notebook."""

import csv
import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
STYLE = ROOT / "python/vines/figures.mplstyle"

spec = importlib.util.spec_from_file_location("notebooks", ROOT / "scripts" / "notebooks.py")
notebooks = importlib.util.module_from_spec(spec)
spec.loader.exec_module(notebooks)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_draws_its_figure(example, tmp_path):
    subprocess.run([sys.executable, example], check=True, cwd=tmp_path, env=os.environ | {"MPLBACKEND": "agg"})
    assert (tmp_path / f"{example.stem}.svg").stat().st_size > 10_000


def test_the_gallery_has_every_example():
    assert sorted(notebooks.NAMES) == [example.stem for example in EXAMPLES]
    assert (ROOT / "docs/gallery.md").read_text() == notebooks.page()


def test_the_colours_of_python_figures_are_those_of_the_program():
    with (ROOT / "lab/src/report/styles.csv").open() as table:
        styles = {row["light"] for row in csv.DictReader(table)} | {"#000000"}
    for file in (STYLE, *EXAMPLES):
        found = re.findall(r"(?:#|'|: )([0-9A-F]{6})\b", file.read_text())
        assert {f"#{colour}" for colour in found} <= styles, file.name
