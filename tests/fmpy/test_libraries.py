"""The libraries in the FMUs: small, stripped, and without paths of the machine that built them."""

from pathlib import Path

import pytest

from component import Fmu
from references import ROOT

MAX_SIZE = {"LoViNes": 1_200_000, "PhaseLock": 1_000_000}
"""Bytes. The library of LoViNes.fmu is that of Structure.fmu as well, with the modes of matrices: a third of it."""


@pytest.fixture(params=["LoViNes", "PhaseLock"])
def library(request: pytest.FixtureRequest, fmus: dict[str, Fmu]) -> Path:
    """The library of one FMU."""
    (found,) = Path(fmus[request.param].folder).glob("binaries/*/*")
    return found


def test_a_library_is_small(library: Path) -> None:
    assert library.stat().st_size <= MAX_SIZE[library.stem]


def test_a_library_contains_no_symbol_table_and_no_debug_information(library: Path) -> None:
    content = library.read_bytes()
    # Names of sections are C strings. (Rust's standard library contains some of them as other text.)
    assert b"\0.dynsym\0" in content
    assert b"\0.symtab\0" not in content
    assert b"\0.debug_info\0" not in content


def test_a_library_contains_no_path_of_the_builder(library: Path) -> None:
    content = library.read_bytes()
    for folder in (ROOT, Path.home(), Path.home() / ".cargo"):
        assert bytes(folder) + b"/" not in content, folder
