"""Every example in docstrings and in docs/python.md runs."""

import doctest
import importlib
import os
import pkgutil
import re
import shlex
import subprocess
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray

import vines

MODULES = [vines, *(importlib.import_module(f"vines.{one.name}") for one in pkgutil.iter_modules(vines.__path__))]
OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
NAMES = {name: getattr(vines, name) for name in vines.__all__} | {"np": np, "vines": vines}


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_the_examples_of_a_module_run(module, tmp_path):
    assert doctest.testmod(module, extraglobs=NAMES | {"folder": tmp_path}, optionflags=OPTIONS).failed == 0


def test_the_examples_of_the_page_run(tmp_path):
    page = Path(__file__).parents[2] / "docs" / "python.md"
    result = doctest.testfile(str(page), False, globs={"folder": tmp_path}, optionflags=OPTIONS)
    assert result.attempted > 10
    assert result.failed == 0


def test_the_commands_and_the_example_of_the_page_on_sweeps_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs" / "scale.md").read_text()
    blocks = re.findall(r"```(sh|python)\n(.*?)```", page, re.DOTALL)
    commands = [
        line for kind, block in blocks if kind == "sh" for line in block.splitlines() if line.startswith("vines")
    ]
    assert len(commands) == 5
    for command in commands:
        # Fewer cells: five per axis, and twenty samples.
        words = shlex.split(re.sub(r"(=[-\d.]+:[-\d.]+):\d+", r"\1:5", command).replace("10000", "20"))
        subprocess.run([os.environ["VINES"], *words[1:], "--periods=400"], check=True)
    examples = [block for kind, block in blocks if kind == "python"]
    matplotlib.use("agg")
    assert len(examples) == 1
    exec(examples[0], {})
    assert xarray.open_zarr("map.zarr").regime.shape == (5, 5)


def test_every_public_name_has_a_docstring_with_its_errors():
    for name in vines.__all__[:-1]:
        assert getattr(vines, name).__doc__
    for function in (vines.fmu, vines.identify, vines.backbone, vines.orbits, vines.theory, vines.regime, vines.sweep):
        assert "Raises\n" in function.__doc__
        assert "Examples\n" in function.__doc__
