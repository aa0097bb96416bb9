"""Units and masks of the numbers and arrays that the package takes."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import xarray

import vines


@dataclass
class Quantity:
    """A number with a unit, as those of pint, astropy and unyt are: value, unit, and float() without the unit."""

    magnitude: Any
    units: str
    shape: tuple[int, ...] = field(init=False, default=())

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.array(self.magnitude, dtype=dtype)

    def __float__(self) -> float:
        return float(self.magnitude)


def array(values: Any, unit: str, **more: Any) -> xarray.DataArray:
    return xarray.DataArray(values, attrs={"units": unit, **more})


KINDS = {"quantity": Quantity, "DataArray": array}
SCENE = vines.Scene()
# Of points that vines has not measured, the scene says what the sensor reads.
STATED = vines.Scene(resonance={"sensor": "v"})
POINTS = {name: np.full(5, 1.0) for name in ("A_m", "u_A_m", "f_Hz", "u_f_Hz", "E_m", "u_E_m")}
RECORDING = vines.Recording("mine", ("y", "x"), 1e-3, np.ones(3), np.ones(3))
AXES = {"plant.r": [0.65]}
SHAKER = "[plant]; M = 3.8; k = 11680; c = 2.5; m = 0.032; b = 0.01; r = 0.65; [excitation]; G = 1.1; [shaker]; "
SHAKER += "mass = 9; stiffness = 9e4; stinger_stiffness = 3e7; table_mass = 4; resistance = 1; Bl = 120"


def structure() -> vines.StructurePlant:
    return vines.StructurePlant(vines.Scene(text=SHAKER.replace("; ", "\n")))


def stated(start: dict[str, Any]) -> vines.Plant:
    plant = vines.Plant(SCENE)
    plant.state = start
    return plant


# Every number of the package: a value in SI units, a call with it, and a unit of the same quantity with its factor.
NUMBERS = {
    "Plant, parameter": (0.01, lambda one: vines.Plant(SCENE.settings["plant"] | {"b": one}), ("mm", 1e3)),
    "Plant, start": (0.5, lambda one: vines.Plant(SCENE, dq2=one), ("mm/s", 1e3)),
    "Plant.state": (0.5, lambda one: stated({"dq2": one}), ("mm / s", 1e3)),
    "Plant.advance, duration": (0.1, lambda one: vines.Plant(SCENE, dq2=0.5).advance(one), ("ms", 1e3)),
    "Plant.advance, amplitude": (
        1e-4,
        lambda one: vines.Plant(SCENE, dq2=0.5).advance(1.0, amplitude=one, omega=55.0),
        ("micrometer", 1e6),
    ),
    "Plant.trajectory, omega": (
        20 * np.pi,
        lambda one: vines.Plant(SCENE, dq2=0.5).trajectory(1.0, 10, amplitude=1e-4, omega=one),
        ("Hz", 0.5 / np.pi),
    ),
    "Batch, parameter": (0.01, lambda one: vines.Batch(SCENE.settings["plant"] | {"b": one}).advance(1.0), ("mm", 1e3)),
    "Batch.advance": (0.1, lambda one: vines.Batch(SCENE, {"dq2": [0.5]}).advance(one), ("ms", 1e3)),
    "StructurePlant": (2.0, lambda one: structure().trajectory(0.1, 10, amplitude=one, omega=55.0), ("mV", 1e3)),
    "PhaseLock.sample": (1e-3, lambda one: vines.PhaseLock(SCENE).sample(one), ("mm", 1e3)),
    "Scene": (0.02, lambda one: vines.Scene(plant={"b": one}), ("cm", 1e2)),
    "Scene.detuning": (55.0, lambda one: SCENE.detuning(one), ("rad/s", 1.0)),
    "fit, points": (1.0, lambda one: vines.fit(POINTS | {"A_m": 5 * [one]}, STATED), ("mm", 1e3)),
    "fit, known": (0.01, lambda one: vines.fit(vines.backbone(SCENE).points, known={"b": (one, 1e-4)}), ("mm", 1e3)),
    "sweep": (0.01, lambda one: vines.sweep(None, {"plant.b": [one]}, periods=100), ("mm", 1e3)),
    "Recording": (2e-3, lambda one: vines.Recording("", ("y", "x"), one, [1.0], [1.0]).sample_time, ("ms", 1e3)),
    "read_recording": (1e-3, None, ("ms", 1e3)),
}
PURE = {
    "orbits": lambda one: vines.orbits(SCENE, one),
    "regime": lambda one: vines.regime(SCENE, one, 100),
    "Scene.drive": lambda one: SCENE.drive(one),
    "Scene.drive, G": lambda one: SCENE.drive(0.0, one),
    "sweep, sigma": lambda one: vines.sweep(None, AXES, sigma=one, periods=100),
    "Plant, r": lambda one: vines.Plant(SCENE.settings["plant"] | {"r": one}),
    "fit, known": lambda one: vines.fit(POINTS, STATED, known={"r": one}),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_with_a_unit_is_converted_or_refused_with_its_unit(name, kind, tmp_path):
    value, call, (unit, factor) = NUMBERS[name]
    if call is None:
        rows = "".join(f"{n / 1000},{n % 7},{n % 5}\n" for n in range(100))
        (tmp_path / "a.csv").write_text(f"t,y,x\n{rows}")

        def call(late):
            return vines.read_recording(tmp_path / "a.csv", "y", "x", late=late).drive

    def result(given):
        try:
            return call(given)
        except ValueError as error:
            # Five equal points have no fit, whatever their unit.
            return str(error)

    expected, found = result(value), result(KINDS[kind](value * factor, unit))
    if isinstance(expected, xarray.Dataset):
        assert expected.equals(found)
    elif isinstance(expected, dict):
        assert all(np.allclose(expected[key], found[key], rtol=1e-9) for key in expected)
    elif isinstance(expected, (np.ndarray, float)):
        assert np.allclose(expected, found, rtol=1e-12)
    else:
        assert repr(expected) == repr(found)
    with pytest.raises(ValueError, match="has the unit kg"):
        call(KINDS[kind](value, "kg"))


@pytest.mark.parametrize("name", PURE)
def test_a_number_without_a_unit_refuses_one_with_a_unit(name):
    with pytest.raises(ValueError, match="has the unit mm/s: a number without a unit is allowed"):
        PURE[name](array(0.6, "mm/s"))
    with pytest.raises(ValueError, match="has the unit %"):
        PURE[name](Quantity(60.0, "%"))


@pytest.mark.parametrize("kind", KINDS)
def test_arrays_with_units_are_converted_and_masked_ones_refused(kind):
    given = KINDS[kind](np.array([400.0, 500.0]), "mm/s")
    for start in (given, [KINDS[kind](one, "mm/s") for one in (400.0, 500.0)]):
        assert np.allclose(vines.Batch(SCENE, {"dq2": start}).states[:, 3], [0.4, 0.5], rtol=1e-15)
    again = vines.Batch(SCENE, {"dq2": given}).to_xarray()
    assert np.array_equal(vines.Batch(SCENE, {"dq2": again.dq2}).states[:, 3], again.dq2)
    with pytest.raises(ValueError, match="masked"):
        vines.Batch(SCENE, {"dq2": np.ma.MaskedArray([0.4, 9e9], [False, True])})


@pytest.mark.parametrize("kind", KINDS)
def test_a_recording_has_si_units_and_masked_samples_are_missing(kind):
    names = ("displacement", "velocity")
    values = np.array([1.0, 2.0, 3.0])
    one = vines.Recording("mine", ("y", "x"), 1e-3, KINDS[kind](values, "mm"), KINDS[kind](values, "cm/s"), 0.0, names)
    assert np.allclose(one.response, 1e-3 * values, rtol=1e-15)
    assert np.allclose(one.drive, 1e-2 * values, rtol=1e-15)
    with pytest.raises(ValueError, match="has the unit mm/s: m, or a number without a unit, is allowed"):
        vines.Recording("mine", ("y", "x"), 1e-3, KINDS[kind](values, "mm/s"), values)
    time = 1e-3 * np.arange(4000)
    response = np.ma.MaskedArray(np.sin(55.0 * time), np.arange(4000) == 700)
    absent = [None if n == 700 else value for n, value in enumerate(np.sin(55.0 * time))]
    for given in (response, absent):
        recording = vines.Recording("mine", ("y", "x"), 1e-3, given, np.sin(55.0 * time))
        assert np.isnan(recording.response).sum() == 1
        with pytest.raises(ValueError, match=r"sample 701 .* is not a finite number"):
            vines.fit_recordings(recording)


def test_an_array_that_is_not_decoded_is_refused():
    for attribute in ("scale_factor", "_FillValue"):
        with pytest.raises(ValueError, match=f"response has the attributes {attribute}: decode it"):
            vines.Recording("mine", ("y", "x"), 1e-3, array(np.ones(3), "mm", **{attribute: 0.1}), np.ones(3))


def test_truth_values_of_other_programs_count_as_what_they_say():
    points = vines.backbone(vines.Scene(backbone={"points": 8})).points
    expected = vines.fit({name: values[:6] for name, values in points.items()})
    for words in (
        (True, False),
        ("True", "False"),
        ("TRUE", "FALSE"),
        ("WAHR", "FALSCH"),
        (1, 0),
        (1.0, 0.0),
        ("1", "0"),
    ):
        settled = np.array(6 * [words[0]] + 2 * [words[1]])
        found = vines.fit(points | {"settled": settled})
        assert len(found.residuals) == 6
        assert found.chi_square == expected.chi_square
    with pytest.raises(ValueError, match="settled = 'maybe' in row 3: True or False is allowed"):
        vines.fit(points | {"settled": np.array(["True", "True", "maybe", "True", "True", "True", "True", "True"])})
