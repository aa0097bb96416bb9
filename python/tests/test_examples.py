"""The examples run and write their figures."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_draws_its_figure(example, tmp_path):
    subprocess.run([sys.executable, example, tmp_path], check=True, env=os.environ | {"MPLBACKEND": "agg"})
    assert (tmp_path / f"{example.stem}.svg").stat().st_size > 10_000


def test_there_are_four_of_them():
    assert len(EXAMPLES) == 4
