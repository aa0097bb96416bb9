"""The scripts: their help, what they refuse before anything is built, and the toolchain that scripts/pack takes."""

import os
import subprocess
from pathlib import Path

import pytest

from references import ROOT

SCRIPTS = sorted(path.name for path in (ROOT / "scripts").iterdir() if os.access(path, os.X_OK))
TRIPLE = "x86_64-pc-windows-gnu"
# Where rustc says that it lives, what apt would install, and where its packages would be unpacked.
SCRIPT = """
. scripts/setup.sh
. scripts/platforms.sh
rustc() { echo "$SYSROOT"; }
rust_web_version() { echo "$APT"; }
RUST_WEB=$WEB
toolchain win64
"""


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_prints_the_comment_at_its_top_as_help(name):
    start = (ROOT / "scripts" / name).read_text().splitlines()[1].strip('#" ').split(";")[0]
    for option in ("-h", "--help"):
        done = subprocess.run([ROOT / "scripts" / name, option], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        assert start in done.stdout


@pytest.mark.parametrize(
    ("command", "words"),
    [
        *[(f"{name} --no-such-option", "unknown") for name in ("bench", "docs", "live", "rehearse", "stress")],
        *[(f"{name} --no-such-option", "unknown") for name in ("test", "test-live", "test-platforms")],
        ("pack --platforms linux64,amiga", "`amiga` is not a platform; known are linux64, linux32, aarch64-linux"),
        ("pack --platforms win64,win64", "the platform win64 was given twice"),
    ],
)
def test_arguments_without_sense_are_refused_before_anything_is_built(command, words, tmp_path):
    name, *arguments = command.split()
    if name == "pack":
        arguments += ["--out", str(tmp_path / "out")]
    done = subprocess.run([ROOT / "scripts" / name, *arguments], capture_output=True, text=True)
    assert done.returncode == 1
    assert words in done.stderr
    assert not (tmp_path / "out").exists()


def toolchain(sysroot: Path, *, apt: str = "", web: Path | None = None) -> subprocess.CompletedProcess:
    web = web or sysroot / "none"
    words = SCRIPT.replace("$SYSROOT", str(sysroot)).replace("$APT", apt).replace("$WEB", str(web))
    return subprocess.run(["bash", "-c", words], cwd=ROOT, capture_output=True, text=True)


def touch(path: Path, mode: int = 0o644) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch(mode)


def test_the_first_toolchain_that_has_the_target_is_taken(tmp_path):
    touch(tmp_path / "web" / "usr" / "bin" / "rustc", 0o755)
    assert toolchain(tmp_path, apt="1.96.0").stdout == "debian\n"
    assert toolchain(tmp_path, web=tmp_path / "web").stdout == "debian\n"
    touch(tmp_path / "lib" / "rustlib" / "src" / "rust" / "library" / "Cargo.lock")
    assert toolchain(tmp_path, apt="1.96.0").stdout == "rust-src\n"
    touch(tmp_path / "lib" / "rustlib" / TRIPLE / "lib" / "libstd.rlib")
    assert toolchain(tmp_path, apt="1.96.0").stdout == "rustup\n"


@pytest.mark.parametrize("apt", ["", "1.85.0"])
def test_without_any_toolchain_the_missing_target_is_named(tmp_path, apt):
    done = toolchain(tmp_path, apt=apt)
    assert done.returncode == 1
    assert done.stdout == ""
    assert f"`rustup target add {TRIPLE}`" in done.stderr
    assert "win64" in done.stderr


def test_nothing_is_packed_where_no_library_is_given(vines, tmp_path):
    done = subprocess.run([vines, "pack", "--only-binaries", "--out", tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "--binary" in done.stderr
    assert not (tmp_path / "out").exists()
