"""FMUs of other tools are accepted, or refused for the true reason."""

import json
import os
import re
import socket
import subprocess
import sys
import time
from math import pi
from random import Random

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from foreign import TOOLS, UNITS, compiled, damaged, describe, drawn, example, library, pack
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
                while server.poll() is None:
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


def test_the_example_of_the_book_is_valid_and_runs_elsewhere(tmp_path):
    fmu = str(example(tmp_path / "mine.fmu", tmp_path))
    assert validate_fmu(fmu) == []
    found = simulate_fmu(fmu, stop_time=1, output_interval=1e-3, start_values={"active": True}, output=["E"])
    assert found["E"][-1] == pytest.approx(92.46e-6)


RIG = """<fmiModelDescription fmiVersion="2.0" modelName="rig" guid="rig">
<CoSimulation modelIdentifier="mine" canHandleVariableCommunicationStepSize="true"/><ModelVariables>
<ScalarVariable name="omega" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="E" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="v" valueReference="2" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="base" valueReference="3" causality="output"><Real/></ScalarVariable>
%s</ModelVariables><ModelStructure/></fmiModelDescription>"""


def variable(name: str, role: str, start: str = "") -> str:
    return f'<ScalarVariable name="{name}" valueReference="4" {role}><Real{start}/></ScalarVariable>'


@pytest.mark.parametrize(
    "role",
    [
        'causality="output"',
        'causality="local"',
        "",
        'causality="local" variability="constant" initial="exact"',
        'causality="calculatedParameter" variability="fixed"',
        'causality="independent" variability="continuous"',
    ],
)
def test_what_is_no_parameter_is_not_set(vines, tmp_path, role):
    start = ' start="0"' if "constant" in role else ""
    controller, rig = (tmp_path / f"{name}.fmu" for name in ("controller", "rig"))
    pack(controller, describe(after=variable("amplitude", role, start)), compiled(tmp_path, "controller.c"))
    pack(rig, RIG % (variable("q1", role, start) + variable("k", role, start)), compiled(tmp_path, "rig.c"))
    done = run(vines, "check", "--rig", rig, "--controller", controller)
    assert done.returncode == 0, done.stderr
    for names in ("k, q1", "amplitude"):
        shown = f"not set before the start, by their causality: {names}"
        other = f"not set before the start, by their causality: {', '.join(reversed(names.split(', ')))}"
        assert shown in done.stdout or other in done.stdout, done.stdout


def test_an_input_that_is_an_output_and_an_output_that_is_an_input_are_refused_by_name(vines, mine, tmp_path):
    for name, wrong, words in [
        ("response", "output", "declares `response` as an output, and the bench sets it at samples"),
        ("active", "parameter", "declares `active` as a parameter that is not tunable"),
        ("omega", "input", "declares `omega` as an input, and the bench reads it"),
    ]:
        right = "output" if name == "omega" else "input"
        head = f'<ScalarVariable name="{name}" valueReference="{["response", "", "active", "omega"].index(name)}"'
        text = describe()
        assert f'{head} causality="{right}"' in text
        fmu = pack(
            tmp_path / "wrong.fmu", text.replace(f'{head} causality="{right}"', f'{head} causality="{wrong}"'), mine
        )
        refused = run(vines, "check", "--controller", fmu)
        assert refused.returncode == 1
        assert words in refused.stderr, refused.stderr
        assert "FMI 2.0 (section 2.2.7)" in refused.stderr
    # What the bench may do without is left out, with a warning.
    unread = describe().replace(
        'name="reference" valueReference="1" causality="input"', 'name="reference" valueReference="1"'
    )
    warned = run(vines, "check", "--controller", pack(tmp_path / "unread.fmu", unread, mine))
    assert warned.returncode == 0
    assert "declares `reference` as a local variable" in warned.stderr


def test_a_unit_that_is_not_defined_is_converted_or_refused_but_never_taken_for_an_si_unit(vines, mine, tmp_path):
    for name, unit, factor in [
        ("E", "mil", None),
        ("E", "parsec", None),
        ("E", "s", None),
        ("omega", "r/min", None),
        ("omega", "1/s", None),
        ("omega", "deg/s", "0.01745"),
        ("omega", "rpm", "0.1047"),
        ("phase_error", "deg", "0.01745"),
        ("phase_error", "gon", None),
        ("E", "um", "1.000e-6"),
    ]:
        defined = UNITS if factor else UNITS.replace("</UnitDefinitions>", f'<Unit name="{unit}"/></UnitDefinitions>')
        fmu = pack(tmp_path / "units.fmu", describe(before=defined, units={name: unit}), mine)
        done = run(vines, "check", "--controller", fmu)
        if factor is None:
            assert done.returncode == 1, unit
            assert f"declares `{name}` in {unit}, a unit that its description does not define" in done.stderr
        else:
            rows = [line.split() for line in done.stdout.splitlines() if line.split()[:1] == [name]]
            assert [row[3] for row in rows] == [unit], done.stdout
            assert float(rows[0][4]) == pytest.approx(float(factor), rel=1e-3)


def test_what_an_fmu_prints_is_no_result(vines, tmp_path):
    fmu = pack(tmp_path / "prints.fmu", describe(), compiled(tmp_path, "controller.c", "-DSAY"))
    arguments = [
        "--controller",
        fmu,
        "--rig",
        "built-in",
        "--out",
        tmp_path / "out",
        "--set",
        "record.decay_periods=20",
    ]
    done = run(vines, "identify", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["lock"]
    assert "licence found" in done.stderr
    assert "t = " in done.stderr


def test_an_fmu_that_changes_the_working_folder_does_not_move_the_results(vines, tmp_path):
    fmu = pack(tmp_path / "moves.fmu", describe(), compiled(tmp_path, "controller.c", "-DFOLDER"))
    plain = pack(tmp_path / "rig.fmu", RIG % "", compiled(tmp_path, "rig.c"))
    arguments = ["--controller", "moves.fmu", "--set", "record.decay_periods=20"]
    kept = {"cwd": tmp_path, "env": os.environ | {"TMPDIR": "temporary"}}
    (tmp_path / "temporary").mkdir()
    done = run(vines, "identify", *arguments, "--rig", "built-in", "--out", "out", "--record", "run.csv", **kept)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out/identification.json").is_file()
    assert (tmp_path / "run.csv").is_file()
    # A run that fails, too, and the FMU that is loaded after one that moves.
    failed = run(vines, "identify", *arguments, "--rig", plain.name, "--no-check", "--out", "failed", **kept)
    assert failed.returncode == 1
    assert (tmp_path / "failed/interrupted.csv").is_file()
    assert not list((tmp_path / "temporary").iterdir())
    assert fmu.is_file()


@pytest.mark.parametrize("option", ["-DSTEPS", "-DOWN_STEPS"])
def test_steps_and_times_are_exact_for_an_fmu_that_compares_within_dbl_epsilon(vines, tmp_path, option):
    fmu = pack(tmp_path / "steps.fmu", describe(), compiled(tmp_path, "controller.c", option))
    arguments = ["--rig", "built-in", "--out", tmp_path / "out", "--set", "record.hold_periods=400"]
    done = run(vines, "identify", "--controller", fmu, *arguments)
    assert done.returncode == 0, done.stderr
