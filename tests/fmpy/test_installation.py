"""What `scripts/install` leaves behind works without the clone."""

import os
import re
import subprocess

from references import ROOT


def test_one_command_installs_program_fmus_completions_and_manual_pages(tmp_path):
    prefix, elsewhere = tmp_path / "installed", tmp_path / "elsewhere"
    elsewhere.mkdir()
    subprocess.run([ROOT / "scripts/install", "--prefix", prefix], check=True, cwd=elsewhere, timeout=1200)
    environment = {"PATH": f"{prefix}/bin:{os.defpath}", "HOME": str(tmp_path)}

    def output(*words: str) -> str:
        return subprocess.run(
            words, check=True, capture_output=True, text=True, cwd=elsewhere, env=environment, timeout=300
        ).stdout

    # The default rig is the FMU beside the program.
    assert "symmetric 1:1" in output("vines", "identify")
    commands = re.findall(r"^  ([a-z]+) ", output("vines", "help").split("Options:")[0], re.MULTILINE)
    pages = {page.name for page in (prefix / "share/man/man1").iterdir()}
    assert pages == {"vines.1", *(f"vines-{name}.1" for name in commands if name != "help")}
    script = prefix / "share/bash-completion/completions/vines"
    assert "-F _vines vines" in output("bash", "-c", f"source {script}; complete -p vines")
