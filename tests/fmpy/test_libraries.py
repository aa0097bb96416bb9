"""The libraries in the FMUs: small, stripped, and without paths of the machine that built them."""

from pathlib import Path

import pytest

from component import Fmu
from references import ROOT

MAX_SIZE = 1_000_000
"""Bytes."""


@pytest.fixture(params=["LoViNes", "PhaseLock"])
def library(request: pytest.FixtureRequest, fmus: dict[str, Fmu]) -> Path:
    """The library of one FMU."""
    (found,) = Path(fmus[request.param].folder).glob("binaries/*/*")
    return found


def test_a_library_is_at_most_a_megabyte(library: Path) -> None:
    assert library.stat().st_size <= MAX_SIZE


def test_a_library_contains_no_symbol_table_and_no_debug_information(library: Path) -> None:
    content = library.read_bytes()
    assert b".dynsym" in content  # section names are there, but not these
    assert b".symtab" not in content
    assert b".debug_" not in content


def test_a_library_contains_no_path_of_the_builder(library: Path) -> None:
    content = library.read_bytes()
    for folder in (ROOT, Path.home(), Path.home() / ".cargo"):
        assert bytes(folder) + b"/" not in content, folder
