"""Build backend: maturin, after the FMUs that belong into the wheel. The sdist is the whole repository."""

import contextlib
import gzip
import io
import os
import shlex
import subprocess
import tarfile
from pathlib import Path

import maturin

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent


@contextlib.contextmanager
def _here():
    """Work in this folder: pip may have been started at the top of the repository or of a source distribution."""
    before = Path.cwd()
    os.chdir(HERE)
    try:
        yield
    finally:
        os.chdir(before)


def _fmus():
    """Build the FMUs with `scripts/pack`, and set the same flags of the compiler for the wheel."""
    out = HERE / "vines" / "fmu"
    pack = ROOT / "scripts" / "pack"
    subprocess.run([pack, "--out", out], check=True, stdout=subprocess.DEVNULL)
    (out / "bench.ssp").unlink(missing_ok=True)
    setup = shlex.quote(str(pack.with_name("setup.sh")))
    flags = subprocess.run(
        ["bash", "-c", f'. {setup}; printf %s "$RUSTFLAGS"'], check=True, capture_output=True, text=True
    )
    os.environ["RUSTFLAGS"] = flags.stdout


def get_requires_for_build_wheel(settings=None):  # noqa: ARG001  the interface of build backends
    """No packages beside those in pyproject.toml."""
    return []


get_requires_for_build_editable = get_requires_for_build_wheel
get_requires_for_build_sdist = get_requires_for_build_wheel


def prepare_metadata_for_build_wheel(directory, settings=None):
    """Write the metadata of the wheel."""
    with _here():
        return maturin.prepare_metadata_for_build_wheel(str(Path(directory).absolute()), settings)


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


def build_wheel(directory, settings=None, metadata=None):
    """Build FMUs and wheel."""
    directory = str(Path(directory).absolute())
    _fmus()
    with _here():
        return maturin.build_wheel(directory, settings, metadata)


def build_editable(directory, settings=None, metadata=None):
    """Build FMUs and compiled part into the source folder, and the wheel that points there."""
    directory = str(Path(directory).absolute())
    _fmus()
    with _here():
        return maturin.build_editable(directory, settings, metadata)


def build_sdist(directory, settings=None):
    """Pack all files that git knows: the FMUs and the compiled part need nearly all of them."""
    with _here():
        metadata = Path(maturin.prepare_metadata_for_build_wheel(str(directory), settings))
        information = (Path(directory) / metadata / "METADATA").read_bytes()
    lines = information.decode().splitlines()
    version = next(line.removeprefix("Version: ") for line in lines if line.startswith("Version: "))
    for one in (Path(directory) / metadata).rglob("*"):
        one.unlink()
    (Path(directory) / metadata).rmdir()
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        raise RuntimeError(f"{ROOT} is no clone: a source distribution has the files that git knows")
    top = f"vines_testbench-{version}"
    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", 0))
    target = Path(directory) / f"{top}.tar.gz"

    def plain(entry):
        entry.uid = entry.gid = 0
        entry.uname = entry.gname = ""
        entry.mtime = epoch
        entry.mode = 0o755 if entry.mode & 0o100 else 0o644
        return entry

    with (
        target.open("wb") as file,
        gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=epoch) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive,
    ):
        entry = tarfile.TarInfo(f"{top}/PKG-INFO")
        entry.size = len(information)
        archive.addfile(plain(entry), io.BytesIO(information))
        for name in sorted(filter(None, listed.stdout.split("\0"))):
            if (ROOT / name).is_file():
                archive.add(ROOT / name, f"{top}/{name}", filter=plain)
    return target.name
