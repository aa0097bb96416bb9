"""The libraries inside the FMUs, as a dynamic linker meets them: symbols, the C library they need, other platforms."""

import os
import re
import subprocess
import zipfile
from pathlib import Path

import pytest

from conftest import ROOT
from scene import Bench

COMPONENTS = ("plant", "controller")
OLDEST_GLIBC = (2, 17)
FOREIGN = {"win64": ("x86_64-windows-gnu", ".dll"), "darwin64": ("aarch64-macos", ".dylib")}
# All functions of FMI 2.0: common ones, those of model exchange, those of co-simulation.
NAMES = """
GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment EnterInitializationMode
ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean SetString
GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate
GetDirectionalDerivative
EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime SetContinuousStates
GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates
SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus GetIntegerStatus
GetBooleanStatus GetStringStatus
"""
FUNCTIONS = {f"fmi2{name}" for name in NAMES.split()}


@pytest.fixture(scope="session")
def zig_path() -> str:
    """The path with cargo-zigbuild and zig on it."""
    tools = ROOT / ".venv-portable" / "bin"
    if not tools.is_dir():
        pytest.skip("cargo-zigbuild is not installed; scripts/clients installs it")
    return f"{tools}{os.pathsep}{os.environ['PATH']}"


@pytest.fixture(scope="session")
def portable(zig_path, tmp_path_factory) -> Bench:
    """The bench for older Linux."""
    folder = tmp_path_factory.mktemp("portable")
    command = [ROOT / "scripts" / "pack", "--portable", "--out", folder]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ | {"PATH": zig_path})
    return Bench(folder)


@pytest.fixture(params=["bench", "portable"])
def either(request) -> Bench:
    """The bench as built for this machine, and the one for older Linux."""
    return request.getfixturevalue(request.param)


def library(bench: Bench, component: str, folder: Path) -> Path:
    """The Linux library of an FMU, taken out."""
    with zipfile.ZipFile(bench.fmu(component)) as archive:
        (name,) = [name for name in archive.namelist() if name.startswith("binaries/linux64/")]
        return Path(archive.extract(name, folder))


def symbols(path: Path) -> str:
    command = ["readelf", "--wide", "--dyn-syms", path]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize("component", COMPONENTS)
def test_a_library_exports_the_functions_of_fmi_and_nothing_else(either, component, tmp_path):
    table = symbols(library(either, component, tmp_path))
    exported = re.findall(r" (?:GLOBAL|WEAK|UNIQUE) +DEFAULT +(?!UND)\S+ (\S+)$", table, re.MULTILINE)
    assert set(exported) == FUNCTIONS


@pytest.mark.parametrize("component", COMPONENTS)
def test_a_portable_library_loads_where_glibc_is_2_17(portable, component, tmp_path):
    table = symbols(library(portable, component, tmp_path))
    versions = [(int(major), int(minor)) for major, minor in re.findall(r"@GLIBC_(\d+)\.(\d+)", table)]
    assert max(versions) <= OLDEST_GLIBC


def test_the_portable_bench_locks_where_the_lab_does(portable, play, check_lock):
    check_lock("portable libraries, FMPy", portable, play("fmpy", "system file", portable))


def build_foreign(target: str, suffix: str, guid: str, folder: Path, path: str) -> Path:
    """A library for another platform: no component, but all that packing asks of one."""
    source = folder / "component.c"
    visible = '__attribute__((visibility("default")))'
    source.write_text(f"""
        {visible} const char *fmi2Instantiate(void) {{ return "{guid}"; }}
        int DllMainCRTStartup(void) {{ return 1; }}
    """)
    made = folder / f"component-{target}{suffix}"
    compiler = ["python3", "-m", "ziglang", "cc", "-target", target, "-shared", "-nostdlib", "-o", made, source]
    subprocess.run(compiler, check=True, env=os.environ | {"PATH": path}, cwd=folder, capture_output=True)
    return made


def guid(bench: Bench, component: str) -> str:
    with zipfile.ZipFile(bench.fmu(component)) as archive:
        return re.search(r'guid="([^"]+)"', archive.read("modelDescription.xml").decode())[1]


def test_one_fmu_serves_several_platforms(vines, bench, zig_path, tmp_path):
    options = []
    for folder, (target, suffix) in FOREIGN.items():
        made = build_foreign(target, suffix, guid(bench, "controller"), tmp_path, zig_path)
        options += ["--binary", f"{folder}={made}"]
    subprocess.run([vines, "pack", "--out", tmp_path, *options], check=True, stdout=subprocess.DEVNULL)
    with zipfile.ZipFile(tmp_path / "PhaseLock.fmu") as archive:
        inside = set(archive.namelist())
    assert {"binaries/win64/PhaseLock.dll", "binaries/darwin64/PhaseLock.dylib"} < inside
    with zipfile.ZipFile(tmp_path / "LoViNes.fmu") as archive:
        assert not [name for name in archive.namelist() if name.endswith((".dll", ".dylib"))]
    with zipfile.ZipFile(tmp_path / "bench.ssp") as archive:
        assert archive.read("resources/PhaseLock.fmu") == (tmp_path / "PhaseLock.fmu").read_bytes()


def test_a_foreign_library_of_another_version_is_refused(vines, zig_path, tmp_path):
    target, suffix = FOREIGN["win64"]
    made = build_foreign(target, suffix, "no guid of ours", tmp_path, zig_path)
    command = [vines, "pack", "--out", tmp_path / "out", "--binary", f"win64={made}"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert "belongs to none of LoViNes, PhaseLock" in done.stderr
    assert not (tmp_path / "out").exists()
