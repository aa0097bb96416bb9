"""Build backend of the wheel: maturin, after the FMUs that belong into it."""

import os
import shlex
import subprocess
from pathlib import Path

import maturin
from maturin import get_requires_for_build_wheel, prepare_metadata_for_build_wheel  # noqa: F401

HERE = Path(__file__).resolve().parent


def build_wheel(directory, settings=None, metadata=None):
    """Build the FMUs with `scripts/pack`, then the wheel with the same flags of the compiler."""
    out = HERE / "vines" / "fmu"
    pack = HERE.parent / "scripts" / "pack"
    subprocess.run([pack, "--out", out], check=True, stdout=subprocess.DEVNULL)
    (out / "bench.ssp").unlink(missing_ok=True)
    setup = shlex.quote(str(pack.with_name("setup.sh")))
    flags = subprocess.run(
        ["bash", "-c", f'. {setup}; printf %s "$RUSTFLAGS"'], check=True, capture_output=True, text=True
    )
    os.environ["RUSTFLAGS"] = flags.stdout
    return maturin.build_wheel(directory, settings, metadata)
