"""The scripts: their help, and arguments that they do not have."""

import os
import subprocess

import pytest

from references import ROOT

SCRIPTS = sorted(path.name for path in (ROOT / "scripts").iterdir() if os.access(path, os.X_OK))


def run(name: str, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run([ROOT / "scripts" / name, *arguments], capture_output=True, text=True)


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_prints_the_comment_at_its_top_as_help(name):
    start = (ROOT / "scripts" / name).read_text().splitlines()[1].strip('#" ').split(";")[0]
    for option in ("-h", "--help"):
        done = run(name, option)
        assert (done.returncode, done.stderr) == (0, "")
        assert start in done.stdout


@pytest.mark.parametrize("name", ["bench", "docs", "live", "rehearse", "stress", "test", "test-live", "test-platforms"])
def test_a_script_refuses_an_unknown_argument_before_anything_is_built(name):
    done = run(name, "--no-such-option")
    assert done.returncode == 1
    assert "unknown" in done.stderr
