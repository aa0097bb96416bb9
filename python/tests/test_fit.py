"""The fit of a rig's parameters from Python."""

import numpy as np
import pytest

import vines

TRUTH = {"r": 0.65, "b": 0.01, "epsilon": 0.032 / 3.807}
SPRING = "nonlinear spring, no particle"


@pytest.fixture(scope="module")
def points():
    return vines.backbone(vines.Scene(backbone={"points": 10})).points


def row(fit, hypothesis):
    """The numbers of one hypothesis."""
    place = list(fit.hypotheses["hypothesis"]).index(hypothesis)
    return {name: values[place] for name, values in fit.hypotheses.items()}


def test_a_wrong_scene_is_corrected_by_the_points(points):
    wrong = vines.Scene(plant={"r": 0.75, "b": 0.011, "m": 0.036, "c": 2.0})
    fit = vines.fit(points, wrong)
    assert fit.describes
    assert fit.best == "ideal cavity"
    ideal = row(fit, fit.best)
    assert ideal["excluded"] is None
    assert ideal["chi_square"] == fit.chi_square
    for symbol, truth in TRUTH.items():
        value, uncertainty = fit[symbol]
        assert abs(value - truth) < 2 * uncertainty < 0.5 * truth, (symbol, value, uncertainty)
        # Without friction the same points determine ten times as much.
        assert abs(ideal[symbol] - truth) < 4 * ideal[f"u_{symbol}"] < 0.04 * truth, (symbol, ideal)
        assert uncertainty > 10 * ideal[f"u_{symbol}"]


def test_the_range_is_that_of_the_hypotheses_that_are_possible(points):
    fit = vines.fit(points)
    possible = np.array([one is None for one in fit.hypotheses["excluded"]])
    assert possible.sum() >= 5
    for symbol in ("f0", "zeta", "r", "b", "epsilon"):
        values, uncertainties = (fit.hypotheses[name][possible] for name in (symbol, f"u_{symbol}"))
        value, uncertainty = fit[symbol]
        assert value - uncertainty == pytest.approx(min(values - uncertainties), rel=1e-12)
        assert value + uncertainty == pytest.approx(max(values + uncertainties), rel=1e-12)
    spring = row(fit, SPRING)
    assert "chi-square" in spring["excluded"] or "p = " in spring["excluded"]
    assert np.isnan(spring["b"])
    of_ideal = fit.channels["hypothesis"] == "ideal cavity"
    assert list(fit.channels["channel"][of_ideal]) == ["responses", "frequencies", "drives"]
    assert fit.channels["expected"][of_ideal].sum() == pytest.approx(fit.degrees)


def test_what_is_known_excludes_hypotheses_and_narrows_the_range(points):
    wide = vines.fit(points)
    assert not np.isnan(row(wide, "tilt")["friction"])
    narrow = vines.fit(points, known=dict.fromkeys(("mu", "theta", "k_r", "v_y", "h"), 0))
    named = set(narrow.hypotheses["hypothesis"])
    assert named == {"ideal cavity", "gain of the reference", "nonlinear spring, no particle"}
    assert np.isnan(narrow.hypotheses["friction"]).all()
    assert narrow["b"][1] < 0.5 * wide["b"][1]
    # The data determine the gain of the reference better than most calibrations do.
    good = vines.fit(points, known={"mu": 0}, calibration=1e-4)
    gains = [row(one, "gain of the reference")["u_strength"] for one in (narrow, good)]
    assert gains[1] < 1e-4 < gains[0] < 0.01
    with pytest.raises(ValueError, match="calibration = -1"):
        vines.fit(points, calibration=-1.0)


def test_friction_of_a_rig_is_within_the_range_and_in_its_row():
    real = vines.backbone(vines.Scene(backbone={"points": 10}, plant={"mu_k": 0.03})).points
    fit = vines.fit(real, known={"b": (0.01, 2e-5), "epsilon": (TRUTH["epsilon"], 2e-5)})
    friction = row(fit, "friction")
    assert friction["excluded"] is None
    assert abs(friction["strength"] - 0.03) < 3 * friction["u_strength"] < 0.03
    assert row(fit, "ideal cavity")["excluded"]
    for symbol, truth in TRUTH.items():
        value, uncertainty = fit[symbol]
        assert abs(value - truth) < 3 * uncertainty, (symbol, value, uncertainty)


def test_a_known_mass_gives_a_plant_for_a_scene(points):
    fit = vines.fit(points, known={"m": (0.032, 0.0003)})
    plant = vines.Scene(plant=fit.plant).settings["plant"]
    assert plant["M"] == pytest.approx(3.807, rel=0.03)
    assert plant["r"] == pytest.approx(0.65, abs=1e-3)
    assert np.allclose(np.diag(fit.correlations), 1)
    assert {"M", "u_M", "c", "u_c"} <= set(fit.hypotheses)


def test_the_linear_response_is_data_if_one_state_of_the_particle_agrees(points):
    omega0, zeta, epsilon = (11.68e3 / 3.807) ** 0.5, 2.53 / (2 * (11.68e3 * 3.807) ** 0.5), 0.032 / 3.807
    known = {"mu": 0}
    for added, state in ((0.0, "free"), (epsilon, "carried"), (epsilon / 2, "unknown")):
        f0 = omega0 / (2 * np.pi) / np.sqrt(1 + added)
        one = {"f0_Hz": f0, "u_f0_Hz": 1e-5 * f0, "zeta": zeta / np.sqrt(1 + added), "u_zeta": 1e-3 * zeta}
        fit = vines.fit(points, linear=[one | {"correlation": 0.0, "particle": "unknown"}], known=known)
        assert [verdict["linear"]["particle"] for verdict in fit.linear] == [state]
        assert fit.describes
        assert not fit.undetermined
    # The columns of tracked.csv.
    columns = {f"linear_{name}": [value] * len(points["f_Hz"]) for name, value in one.items()}
    columns |= {"linear_correlation": [0.0], "linear_particle": ["unknown"]}
    fit = vines.fit(points | columns, known=known)
    assert fit.linear[0]["linear"]["f0_Hz"] == f0


def test_points_of_another_program_need_a_scene_that_says_what_the_sensor_reads(points):
    foreign = {name: points[name] for name in ("f_Hz", "A_m", "E_m", "u_f_Hz", "u_A_m", "u_E_m")}
    with pytest.raises(ValueError, match=r'resonance\.sensor = "q1"'):
        vines.fit(foreign)
    fit = vines.fit(foreign, vines.Scene(resonance={"sensor": "v"}))
    assert fit["b"] == vines.fit(points)["b"]


def test_rows_locks_and_columns_that_are_missing(points):
    first = {name: values[0] for name, values in points.items()}
    with pytest.raises(ValueError, match="no column u_E_m"):
        vines.fit({name: value for name, value in first.items() if name != "u_E_m"})
    with pytest.raises(ValueError, match="1 points are too few"):
        vines.fit([first])
    with pytest.raises(ValueError, match="SYMBOL=VALUE"):
        vines.fit(points, known={"mass": 1.0})
