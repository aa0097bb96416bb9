"""The fit of a rig's parameters from Python."""

import numpy as np
import pytest

import vines


@pytest.fixture(scope="module")
def points():
    return vines.backbone(vines.Scene(backbone={"points": 10})).points


def test_a_wrong_scene_is_corrected_by_the_points(points):
    wrong = vines.Scene(plant={"r": 0.75, "b": 0.011, "m": 0.036, "c": 2.0})
    fit = vines.fit(points, wrong)
    assert fit.describes
    assert fit.left_out == ()
    for symbol, truth in (("r", 0.65), ("b", 0.01), ("epsilon", 0.032 / 3.807)):
        value, uncertainty = fit[symbol]
        assert abs(value - truth) < 4 * uncertainty, (symbol, value, uncertainty)
        assert uncertainty < 0.01 * truth, (symbol, value, uncertainty)


def test_a_known_mass_gives_a_plant_for_a_scene(points):
    fit = vines.fit(points, known={"m": (0.032, 0.0003)})
    plant = vines.Scene(plant=fit.plant).settings["plant"]
    assert plant["M"] == pytest.approx(3.807, rel=0.03)
    assert plant["r"] == pytest.approx(0.65, abs=1e-3)
    assert np.allclose(np.diag(fit.correlations), 1)


def test_the_linear_response_is_data_if_one_state_of_the_particle_agrees(points):
    omega0, zeta, epsilon = (11.68e3 / 3.807) ** 0.5, 2.53 / (2 * (11.68e3 * 3.807) ** 0.5), 0.032 / 3.807
    for added, state in ((0.0, "free"), (epsilon, "carried"), (epsilon / 2, "unknown")):
        f0 = omega0 / (2 * np.pi) / np.sqrt(1 + added)
        one = {"f0_Hz": f0, "u_f0_Hz": 1e-5 * f0, "zeta": zeta / np.sqrt(1 + added), "u_zeta": 1e-3 * zeta}
        fit = vines.fit(points, linear=[one | {"correlation": 0.0, "particle": "unknown"}])
        assert [verdict["linear"]["particle"] for verdict in fit.linear] == [state]
        assert fit.describes
        assert not fit.undetermined
    # The columns of tracked.csv.
    columns = {f"linear_{name}": [value] * len(points["f_Hz"]) for name, value in one.items()}
    fit = vines.fit(points | columns | {"linear_correlation": [0.0], "linear_particle": ["unknown"]})
    assert fit.linear[0]["linear"]["f0_Hz"] == f0


def test_rows_locks_and_columns_that_are_missing(points):
    row = {name: values[0] for name, values in points.items()}
    with pytest.raises(ValueError, match="no column u_E_m"):
        vines.fit({name: value for name, value in row.items() if name != "u_E_m"})
    with pytest.raises(ValueError, match="1 points are too few"):
        vines.fit([row])
    with pytest.raises(ValueError, match="SYMBOL=VALUE"):
        vines.fit(points, known={"mass": 1.0})
