"""FMUs of other tools are accepted, or refused for the true reason."""

import re
import socket
import subprocess
import sys
import time
from math import pi
from random import Random

import pytest
from fmpy import read_model_description

from foreign import TOOLS, UNITS, damaged, describe, drawn, library, pack
from references import ROOT

CYCLES = (
    '<Unit name="Hz"><BaseUnit s="-1"/></Unit><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit></UnitDefinitions>'
)


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    return library(tmp_path_factory.mktemp("mine"))


def run(vines, *arguments, **environment):
    done = subprocess.run([vines, *map(str, arguments)], capture_output=True, text=True, **environment)
    assert "panicked" not in done.stderr
    return done


def is_valid(fmu) -> bool:
    """FMPy decides."""
    try:
        read_model_description(str(fmu), validate=True, validate_variable_names=False, validate_model_structure=False)
    except Exception:  # FMPy raises many kinds.
        return False
    return True


@pytest.mark.parametrize("tool", TOOLS)
def test_a_controller_with_the_description_of_a_tool_is_used(vines, mine, tmp_path, tool):
    fmu = pack(tmp_path / "tool.fmu", TOOLS[tool], mine)
    done = run(vines, "check", "--controller", fmu)
    assert done.returncode == 0, done.stderr
    assert "as on the bench: response, reference, active, omega, E, phase_error" in done.stdout
    unknown = "isValueChangeable" in TOOLS[tool]
    assert ("beyond FMI 2.0" in done.stderr) == unknown, done.stderr
    assert unknown or is_valid(fmu)


def test_300_descriptions_that_fmpy_validates_are_all_read(vines, tmp_path):
    random = Random(46)
    for n in range(300):
        fmu = pack(tmp_path / "drawn.fmu", drawn(random))
        assert is_valid(fmu)
        done = run(vines, "check", "--controller", fmu)
        assert "it has no libraries" in done.stderr, f"{n}: {done.stderr}"


def test_100_damaged_descriptions_get_a_sentence_each(vines, tmp_path):
    random = Random(47)
    for n in range(100):
        fmu = pack(tmp_path / "damaged.fmu", damaged(random, drawn(random)))
        assert not is_valid(fmu)
        done = run(vines, "check", "--controller", fmu)
        last = done.stderr.strip().splitlines()[-1]
        assert done.returncode == 1, f"{n}: {last}"
        assert "cannot load" in last
        assert "modelDescription.xml: " in last or "FMI version" in last, f"{n}: {last}"
        assert len(last) < 400, f"{n}: {last}"


def sigma(vines, folder, *arguments):
    done = run(vines, "identify", "--json", "--out", folder, "--set", "record.decay_periods=20", *arguments)
    assert done.returncode == 0, done.stderr
    return float(done.stdout.split('"sigma":')[1].split(",")[0])


def test_declared_units_are_converted_and_overridden_by_the_scene_only(vines, mine, tmp_path):
    scaled = library(tmp_path, 2 * pi, 1e-3)
    units = {"omega": "Hz", "E": "mm"}
    fmu = pack(
        tmp_path / "units.fmu", describe(before=UNITS.replace("</UnitDefinitions>", CYCLES), units=units), scaled
    )
    shown = run(vines, "check", "--controller", fmu).stdout
    assert any(line.split() == ["E", "m", "E", "mm", "0.001000"] for line in shown.splitlines()), shown
    plain = pack(tmp_path / "plain.fmu", describe(), mine)
    one, other = (sigma(vines, tmp_path / "out", "--controller", file) for file in (plain, fmu))
    assert one == pytest.approx(other, abs=1e-9)
    wrong = pack(tmp_path / "wrong.fmu", describe(units={"E": "rad/s"}), mine)
    assert "declares `E` in rad/s" in run(vines, "check", "--controller", wrong).stderr
    mapped = ["--set", 'controller_names.E={name="E",factor=1.0}']
    assert run(vines, "check", "--controller", wrong, *mapped).returncode == 0


def test_fixed_steps_are_kept_or_the_fmu_is_refused_before_anything_moves(vines, mine, tmp_path):
    sample = 0.0011343573395537938
    for step, fits in [(sample, True), (sample / 3, True), (0.001, False), (2 * sample, False)]:
        before = f'{UNITS}<DefaultExperiment stepSize="{step!r}"/>'
        interface = 'canHandleVariableCommunicationStepSize="false"'
        fmu = pack(tmp_path / "fixed.fmu", describe(before=before, interface=interface), mine)
        done = run(vines, "check", "--controller", fmu)
        assert (done.returncode == 0) == fits, done.stderr
        assert fits or f"fixed steps of {step} s" in done.stderr
    before = f'{UNITS}<DefaultExperiment stepSize="0.001"/>'
    fmu = pack(tmp_path / "fixed.fmu", describe(before=before, interface=interface), mine)
    samples = f"controller.samples_per_period={100 * sample / 0.001!r}"
    assert run(vines, "check", "--controller", fmu, "--set", samples).returncode == 0


def test_archives_encodings_and_platforms(vines, mine, tmp_path):
    described = describe('author="Müller µ"')
    latin = described.replace("UTF-8", "ISO-8859-1").encode("latin-1")
    for n, (text, prefix) in enumerate(
        [(latin, ""), (described, "./"), (described.replace("UTF-8", "UTF-16").encode("utf-16"), "")]
    ):
        done = run(vines, "check", "--controller", pack(tmp_path / f"{n}.fmu", text, mine, prefix=prefix))
        assert done.returncode == 0, done.stderr
        assert "beyond" not in done.stderr
    windows = run(vines, "check", "--controller", pack(tmp_path / "win.fmu", described, mine, platform="win64"))
    assert "libraries for win64 only, and this machine needs binaries/linux64/mine.so" in windows.stderr
    folder = run(vines, "check", "--controller", pack(tmp_path / "folder.fmu", described, mine, prefix="mine/"))
    assert "zip the content of that folder" in folder.stderr


def test_what_a_backbone_lacks_and_where_nothing_can_be_unpacked_is_said(vines, mine, tmp_path):
    fmu = pack(tmp_path / "mine.fmu", describe(), mine)
    lacks = run(vines, "backbone", "--rig", "built-in", "--controller", fmu, "--out", tmp_path / "out")
    assert lacks.returncode == 1
    assert "it lacks `hold_response`, `phase_target`, `move.response`" in lacks.stderr
    for arguments in [["--controller", fmu, "--rig", "built-in"], []]:
        nowhere = run(vines, "identify", *arguments, "--out", tmp_path / "out", env={"TMPDIR": "/nonexistent"})
        assert "set TMPDIR to a folder" in nowhere.stderr
        assert "built-in" in nowhere.stderr


DRIVE = "s->x[E] = s->x[ACTIVE] ? amplitude : 0;"
PHASE = "carg(s->response / s->base * I)"


@pytest.mark.parametrize(
    ("code", "instead", "said"),
    [
        (DRIVE, "s->x[E] = amplitude;", "it commands E = 9.246e-5 m, "),
        (DRIVE, "s->x[E] = s->x[ACTIVE] ? amplitude : 1e-9;", "it commands E = 1e-9 m"),
        (DRIVE, "s->x[E] = s->x[ACTIVE] ? amplitude : s->x[E] * 0.999;", "does not release the drive"),
        (PHASE, "carg(s->response / s->base * I * cexp(-0.349 * I))", "is 20.00 ± "),
        (DRIVE, "s->x[E] = s->x[ACTIVE] ? 2 * amplitude : 0;", "2.000 times the requested G = 1.1000"),
        (DRIVE, "s->x[E] = s->x[ACTIVE] ? 0.5 * amplitude : 0;", "0.500 times the requested G = 1.1000"),
        (DRIVE, "s->x[E] = s->x[ACTIVE] ? 1.09 * amplitude : 0;", "the result is at another drive than"),
    ],
)
def test_a_controller_that_does_not_do_what_it_is_asked_for_is_named_with_exit_code_1(
    vines, tmp_path, code, instead, said
):
    fmu = pack(tmp_path / "mine.fmu", describe(), library(tmp_path, changed=(code, instead)))
    settings = ["--set", "record.decay_periods=20", "--set", "phase_lock.acquire_timeout=60"]
    done = run(vines, "identify", "--rig", "built-in", "--controller", fmu, "--out", tmp_path / "out", *settings)
    assert done.returncode == 1, done.stdout
    assert said in done.stderr, done.stderr
    # The result is kept.
    assert (tmp_path / "out" / "identification.json").exists() == ("the result is" in said)


def test_a_decay_begins_at_the_end_of_a_slow_ramp(vines, tmp_path):
    ramp = (DRIVE, "s->x[E] = s->x[ACTIVE] ? amplitude : fmax(s->x[E] - amplitude / 400, 0);")
    fmu = pack(tmp_path / "mine.fmu", describe(), library(tmp_path, changed=ramp))
    done = run(vines, "identify", "--rig", "built-in", "--controller", fmu, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    first = float(done.stdout.split("points from C = ")[1].split()[0])
    assert 0.3 < first < 0.44, done.stdout


def test_a_network_controller_that_does_not_release_the_drive_is_an_error(vines, tmp_path):
    page = (ROOT / "docs/own-controller.md").read_text()
    (code,) = re.findall(r"```python\n(# controller.py.*?)```", page, re.DOTALL)
    released = "AMPLITUDE if flags & 1 else 0.0, 0.0, error"
    assert released in code
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    for instead, said in [
        ("AMPLITUDE, 0.0, error", "it commands E = "),
        ("AMPLITUDE if flags & 1 else 0.0, AMPLITUDE * math.sin(theta), error", "E = 0, but a displacement of"),
    ]:
        (tmp_path / "controller.py").write_text(code.replace(released, instead))
        with subprocess.Popen([sys.executable, tmp_path / "controller.py", str(port)]) as server:
            try:
                for _ in range(100):
                    with socket.socket() as link:
                        if link.connect_ex(("127.0.0.1", port)) == 0:
                            break
                    time.sleep(0.1)
                address = f"tcp://127.0.0.1:{port}"
                done = run(vines, "identify", "--rig", "built-in", "--controller", address, "--out", tmp_path / "out")
            finally:
                server.kill()
        assert done.returncode == 1, done.stdout
        assert said in done.stderr, done.stderr


def test_a_controller_that_logs_without_end_does_not_stop_the_loop(vines, tmp_path):
    library(tmp_path)
    code = (tmp_path / "mine.c").read_text()
    logger = "typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);"
    kept = "callback = *(Logger *)callbacks; environment = ((void *const *)callbacks)[4];"
    said = 'callback(environment, "mine", 1, "log", "%01000d", 7);'
    for before, after in [
        ("typedef int Status;", f"typedef int Status;\n{logger}\nstatic Logger callback;\nstatic void *environment;"),
        ("return calloc(1, sizeof(Loop));", f"{kept} return calloc(1, sizeof(Loop));"),
        ("{ sample(s, step); return 0; }", f"{{ sample(s, step); {said} return 0; }}"),
    ]:
        assert before in code
        code = code.replace(before, after)
    (tmp_path / "mine.c").write_text(code)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "mine.c", "-lm", "-o", "mine.so"], cwd=tmp_path, check=True)
    fmu = pack(tmp_path / "noisy.fmu", describe(), (tmp_path / "mine.so").read_bytes())
    command = [vines, "identify", "--controller", fmu, "--rig", "built-in", "--out", tmp_path / "out"]
    # Nobody reads this pipe while the program runs.
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as loop:
        assert loop.wait(timeout=600) == 0
        assert loop.stderr.read().count(b"noisy.fmu: 000") == 20
