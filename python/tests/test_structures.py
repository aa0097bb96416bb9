"""Structures: as plants under a voltage, and from the universal files of a modal test."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import pyuff
from fmpy import simulate_fmu

import vines

SCENES = Path(__file__).parents[2] / "scenes"
SAMPLES = Path(__file__).parent / "data"

OMEGA = 2 * np.pi * np.array([8.8, 55.1])
ZETA = np.array([0.006, 0.011])
# Mass-normalised shapes, 1/sqrt(kg), at the nodes 1 and 12 in Z.
SHAPES = np.array([[0.1, 0.51], [0.3, -0.49]])


def normal(n: int, mass: float = 1.0, scale: float = 1.0) -> dict:
    """A normal mode whose shape is scaled so that it has a modal mass."""
    shape = SHAPES[n] * np.sqrt(mass) * scale
    mode = {"analysis_type": 2, "freq": OMEGA[n] / (2 * np.pi), "modal_m": mass, "modal_damp_vis": ZETA[n]}
    return {**mode, "modal_damp_his": 0.0, "r3": shape}


def complex_mode(n: int) -> dict:
    """A mode as a complex eigenvalue with an arbitrary factor of its vector."""
    damped, factor = OMEGA[n] * np.sqrt(1 - ZETA[n] ** 2), 2.0 * np.exp(0.7j)
    pole = complex(-ZETA[n] * OMEGA[n], damped)
    return {
        "analysis_type": 3,
        "eig": pole,
        "modal_a": factor**2 * 2j * damped,
        "modal_b": 0j,
        "r3": factor * SHAPES[n],
    }


def write(file, modes, units=(1, 1.0, 1.0)):
    """Write data sets 55, and the units in data set 164."""
    uff = pyuff.UFF(str(file))
    if units:
        code, length, force = units
        uff.write_sets(
            {"type": 164, "units_code": code, "length": length, "force": force, "temp": 1.0, "temp_offset": 0.0}
        )
    for n, mode in enumerate(modes, 1):
        zero = np.zeros(2, dtype=np.asarray(mode["r3"]).dtype)
        more = {"type": 55, "model_type": 1, "data_ch": 2, "spec_data_type": 8, "load_case": 0, "mode_n": n}
        ids = {f"id{k}": "NONE" for k in range(1, 6)}
        whole = more | ids | {"node_nums": np.array([1, 12]), "r1": zero, "r2": zero} | mode
        uff.write_sets(whole | {"n_data_per_node": 3, "data_type": 5 if zero.dtype.kind == "c" else 2}, "add")
    return file


@pytest.mark.parametrize(
    ("modes", "units"),
    [
        ([normal(1), normal(0, mass=3.0)], (1, 1.0, 1.0)),
        # Millimetres and millinewtons: the unit of mass is the kilogram.
        ([normal(0), normal(1)], (5, 1000.0, 1000.0)),
        # Inches and pounds of force: masses are in slinches of 175.1268 kg, so that shapes are larger.
        ([normal(0, scale=175.12684**0.5), normal(1, scale=175.12684**0.5)], (7, 39.370079, 0.22480894)),
        ([complex_mode(0), complex_mode(1)], (1, 1.0, 1.0)),
    ],
    ids=["SI", "mm and mN", "inches", "complex"],
)
def test_modes_of_a_universal_file_are_mass_normalised_in_si_units(modes, units, tmp_path):
    file = write(tmp_path / "beam.uff", modes, units)
    found = vines.structure_from_uff(file)
    assert max(found["out_of_phase"]) < 1e-4
    for mode in found["modes"]:
        n = int(mode["frequency"] > 20.0)
        assert mode["frequency"] == pytest.approx(OMEGA[n] / (2 * np.pi), rel=1e-5)
        assert mode["damping"] == pytest.approx(ZETA[n], rel=1e-4)
        assert list(mode["shape"]) == ["1Z", "12Z"]
        assert np.abs(np.array(list(mode["shape"].values()))) == pytest.approx(np.abs(SHAPES[n]), rel=1e-4)
    scene = vines.Scene(text=vines.scene_from_uff(file, "12Z", "1Z"))
    assert scene.dimensionless["omega0"] == pytest.approx(OMEGA[0], rel=1e-5)
    assert scene.dimensionless["epsilon"] == pytest.approx(0.032 * 0.51**2, rel=1e-3)


def test_what_is_out_of_phase_in_complex_shapes_is_named_and_left_out():
    # Two modes of a structure whose damping is not modal, with modal A.
    file = SAMPLES / "modes_complex.uff"
    with pytest.warns(UserWarning, match="out of phase and left out") as noted:
        found = vines.structure_from_uff(file)
    shares = [0.1164, 0.2294]
    assert found["out_of_phase"] == pytest.approx(shares, abs=1e-3)
    assert [str(one.message).partition(": ")[2] for one in noted] == [
        f"mode {n}: {100 * share:.1f} % of the shape are out of phase and left out"
        for n, share in enumerate(found["out_of_phase"], 1)
    ]
    arguments = [sys.executable, "-m", "vines", "structure", str(file), "--cavity", "3Z"]
    done = subprocess.run(arguments, check=True, capture_output=True, text=True)
    for n, share in enumerate(found["out_of_phase"], 1):
        note = f"mode {n}: {100 * share:.1f} % of the shape are out of phase and left out"
        assert f"warning: {file}: {note}\n" in done.stderr
        assert f"# {note}\n" in done.stdout
    assert vines.Scene(text=done.stdout).settings["structure"]["points"] == ["1Z", "2Z", "3Z"]


def test_unknown_units_and_modes_without_mass_are_refused_in_one_sentence(tmp_path):
    file = write(tmp_path / "beam.uff", [normal(0)], None)
    with pytest.raises(ValueError, match=r"units of .* are unknown.*164"):
        vines.structure_from_uff(file)
    assert vines.structure_from_uff(file, units="SI")["modes"][0]["shape"]["12Z"] == pytest.approx(0.51)
    with pytest.raises(ValueError, match="units = 'mm'"):
        vines.structure_from_uff(file, units="mm")
    file = write(tmp_path / "zero.uff", [normal(0), normal(1, mass=0.0)])
    with pytest.raises(ValueError, match=r"mode 2 .* no modal mass"):
        vines.structure_from_uff(file)
    with pytest.raises(ValueError, match=r"cavity: 7Z is no point.*1Z, 12Z"):
        vines.scene_from_uff(write(tmp_path / "good.uff", [normal(0)]), "7Z", "1Z")


def test_the_module_converts_a_universal_file_to_a_scene(tmp_path):
    file = write(tmp_path / "beam.uff", [normal(0), normal(1)])
    arguments = [sys.executable, "-m", "vines", "structure", str(file), "--cavity", "12Z"]
    done = subprocess.run([*arguments, "--drive", "1Z", "--out", str(tmp_path / "beam.toml")], check=True)
    assert done.returncode == 0
    assert vines.Scene(tmp_path / "beam.toml").settings["structure"]["points"] == ["12Z", "1Z"]
    refused = subprocess.run([*arguments, "--drive", "9Z"], capture_output=True, text=True)
    assert refused.returncode == 2
    assert "9Z is no point" in refused.stderr


FRAME = """
[plant]
m = 0.032
b = 0.01
r = 0.65
[structure]
excitation = "force"
cavity = "right"
drive = "left"
modes = [
    { frequency = 8.8156, damping = 0.006, shape = { left = 0.45, right = 0.51252 } },
    { frequency = 9.3, damping = 0.006, shape = { left = 0.51252, right = -0.45 } },
]
[excitation]
G = 1.1
[start]
dq2 = 0.5
"""


def test_a_structure_locks_on_its_exact_orbit_and_what_has_one_oscillator_says_so():
    scene = vines.Scene(text=FRAME)
    found = vines.identify(scene, results="lock")
    orbit = min(vines.orbits(scene), key=lambda one: abs(one.C - found.lock["C"]) if one.stable else np.inf)
    assert found.lock["C"] == pytest.approx(orbit.C, abs=1e-4)
    for refused in (vines.Plant, vines.regime, lambda one: vines.orbits(one, sigma=0.0)):
        with pytest.raises(ValueError, match=r"one oscillator.*\[structure\]"):
            refused(scene)
    with pytest.warns(UserWarning, match="of the driven mode alone, without the other modes"):
        alone = vines.theory(scene)
    assert alone.C_min == pytest.approx(vines.theory().C_min)
    pytest.importorskip("xarray")
    with pytest.raises(ValueError, match="a sweep is of one oscillator"):
        vines.sweep(scene, {"sigma": [0.0]}, periods=400)


def test_a_plant_under_a_voltage_has_the_bits_of_its_fmu_channel_by_channel(tmp_path):
    file = SCENES / "shaker-cantilever.toml"
    subprocess.run([os.environ["VINES"], "pack", "--scene", file, "--out", tmp_path], check=True)
    plant = vines.StructurePlant(vines.Scene(file))
    names = {name: name if unit != "m" else f"q[{name}]" for name, unit in plant.channels.items()}
    names |= {"drive": "command", "q2": "q2", "impacts": "impacts"}
    steps, start = 4096, {"u_amplitude": 3.0, "omega": 53.0}
    fmu = simulate_fmu(
        str(tmp_path / "Structure.fmu"),
        stop_time=4,
        output_interval=4 / steps,
        start_values=start,
        output=[*names.values()],
    )
    motion = plant.trajectory(4.0, steps, amplitude=3.0, omega=53.0)
    assert motion["impacts"][-1] > 10
    for channel, name in names.items():
        np.testing.assert_array_equal(motion[channel][1:], fmu[name][1:], err_msg=name)


def test_a_limit_of_the_shaker_is_an_error_and_leaves_the_plant_as_it_was():
    # A stroke that the drive of the scene needs would be refused.
    scene = vines.Scene(SCENES / "shaker-cantilever.toml", plant={"b": 1e-3}, shaker={"stroke_max": 1e-4})
    plant = vines.StructurePlant(scene)
    plant.advance(0.01, held=0.05)
    before = plant["armature"]
    with pytest.raises(
        RuntimeError, match=r"shaker reached its limit: the displacement of the armature is .* shaker.stroke_max"
    ):
        plant.trajectory(2.0, 2000, amplitude=20.0, omega=53.0)
    plant.advance(0.0)
    assert plant["armature"] == before != 0.0
    with pytest.raises(KeyError, match="'voltage' is no channel; known are time, drive, q2, impacts, root, tip"):
        plant["voltage"]
    with pytest.raises(ValueError, match=r"no \[structure\]"):
        vines.StructurePlant(vines.Scene())


def test_a_limit_that_is_passed_within_a_step_is_an_error_too():
    drive, period = {"amplitude": 8.0, "omega": 53.0}, 2 * np.pi / 53.0
    free = vines.StructurePlant(vines.Scene(SCENES / "shaker-cantilever.toml"))
    force = np.abs(free.trajectory(period, 128, **drive)["force"])
    limit = 0.5 * (force[-1] + force.max())
    assert force[-1] < 0.8 * limit
    plant = vines.StructurePlant(vines.Scene(SCENES / "shaker-cantilever.toml", shaker={"force_max": limit}))
    with pytest.raises(RuntimeError, match=r"the force is .* shaker.force_max"):
        plant.advance(period, **drive)
    assert plant["time"] == 0.0


@pytest.mark.parametrize(
    "changes", [{}, {"shaker": {"compensated_mass": 0.02}, "structure": {"masses": {"tip": 0.005}}}]
)
def test_an_experiment_with_a_shaker_locks_on_its_exact_orbit(changes):
    found = vines.identify(vines.Scene(SCENES / "shaker-cantilever.toml", **changes), results="lock")
    assert abs(found.lock["sigma"] - found.exact.sigma) < 3 * found.lock["u_sigma"]


def test_a_shaker_in_python_is_that_of_its_file():
    from tomllib import loads

    text = (SCENES / "shaker-cantilever.toml").read_text(encoding="utf-8")
    shaker = loads(text)["shaker"]
    without = text[: text.index("[shaker]")] + text[text.index("[excitation]") :]
    assert vines.Scene(text=without, shaker=shaker) == vines.Scene(text=text)
    with pytest.raises(ValueError, match="stinger_stiffness"):
        vines.Scene(text=without, shaker={"mass": 0.057, "stiffness": 9932.0})


def test_after_the_stinger_is_cut_the_channels_are_those_of_the_structure_alone():
    plant = vines.StructurePlant(vines.Scene(SCENES / "shaker-cantilever.toml", shaker={"release": "cut"}))
    driven = plant.trajectory(1.0, 1000, amplitude=1.0, omega=53.0)
    free = plant.trajectory(1.0, 1000, amplitude=0.0, omega=53.0)
    largest = np.abs(driven["force"]).max()
    assert largest > 0.1
    assert np.abs(free["force"][1:]).max() < 1e-6 * largest
    # The motion goes on where it was; the current is that of a shaker whose coil is shorted.
    expected = 2 * driven["tip"][-1] - driven["tip"][-2]
    assert free["tip"][1] == pytest.approx(expected, abs=0.01 * np.abs(driven["tip"]).max())
    assert np.abs(free["current"][-1]) < np.abs(driven["current"]).max()


def test_points_of_a_force_test_have_newtons_and_are_fitted_with_their_scene() -> None:
    scene = vines.Scene(
        SCENES / "frame.toml", resonance={"sensor_quantity": "acceleration"}, backbone={"points": 6, "C_to": 0.4}
    )
    points = vines.backbone(scene).points
    assert [name for name in points if name.endswith(("_m", "_N"))] == ["A_m", "F_N", "u_A_m", "u_F_N"]
    found = vines.fit(points, scene)
    value, uncertainty = found["b"]
    assert found.describes
    assert abs(value - 0.01) < uncertainty
    with pytest.raises(ValueError, match="no column E_m, u_E_m"):
        vines.fit(points)
