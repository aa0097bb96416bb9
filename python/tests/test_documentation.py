"""Every example in docstrings and in docs/python.md runs."""

import doctest
import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pytest

import vines

MODULES = [vines, *(importlib.import_module(f"vines.{one.name}") for one in pkgutil.iter_modules(vines.__path__))]
OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
NAMES = {name: getattr(vines, name) for name in vines.__all__} | {"np": np, "vines": vines}


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_the_examples_of_a_module_run(module, tmp_path):
    assert doctest.testmod(module, extraglobs=NAMES | {"folder": tmp_path}, optionflags=OPTIONS).failed == 0


@pytest.mark.parametrize("page", ["python.md", "scale.md"])
def test_the_examples_of_a_page_run(page, tmp_path):
    path = Path(__file__).parents[2] / "docs" / page
    result = doctest.testfile(str(path), False, globs={"folder": tmp_path}, optionflags=OPTIONS)
    assert result.attempted > 10
    assert result.failed == 0


def test_every_public_name_has_a_docstring_with_its_errors():
    for name in vines.__all__[:-1]:
        assert getattr(vines, name).__doc__
    for function in (vines.fmu, vines.identify, vines.backbone, vines.orbits, vines.theory, vines.regime, vines.sweep):
        assert "Raises\n" in function.__doc__
        assert "Examples\n" in function.__doc__
