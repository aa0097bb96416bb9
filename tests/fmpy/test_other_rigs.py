"""Rigs without a particle across the network: what is measured is right, and said without a particle."""

import csv
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest

from network_rig import DAMPING, MASS, STIFFNESS, LockStepServer, Oscillator

#: Cubic stiffness over the linear one, 1/m²: at 6 mm the frequency rises by 3 %. A negative one softens.
HARDENING = 2222.0
LEVELS = ["backbone.C_from=0.7", "backbone.C_to=0.4", "backbone.points=4", "resonance.sensor=q1"]
#: What nothing but impacts would show.
WORDS = ("1:1", "impact", "particle", "sigma", "regime", "theory", "exact", "linear mode", "backbone ends", "C =")


def harmonic_balance(cubic: float, amplitude: float, phase: float) -> tuple[float, float]:
    """Frequency, Hz, and base, m, that hold a fundamental of this amplitude, m, and phase, rad: five odd harmonics."""
    orders = np.arange(1, 10, 2)
    angles = 2 * np.pi * np.arange(256) / 256
    sines, cosines = np.sin(np.outer(orders, angles)), np.cos(np.outer(orders, angles))

    def residual(unknowns: np.ndarray) -> np.ndarray:
        omega, base = unknowns[0], unknowns[1]
        # The first harmonic is A sin(angle + phase), where the base is E sin(angle).
        a = np.concatenate([[amplitude * math.cos(phase)], unknowns[2:6]])
        b = np.concatenate([[amplitude * math.sin(phase)], unknowns[6:10]])
        q = a @ sines + b @ cosines
        rate = omega * ((orders * a) @ cosines - (orders * b) @ sines)
        inertia = -MASS * omega**2 * ((orders**2 * a) @ sines + (orders**2 * b) @ cosines)
        drive = STIFFNESS * base * np.sin(angles) + DAMPING * omega * base * np.cos(angles)
        force = inertia + DAMPING * rate + STIFFNESS * (q + cubic * q**3) - drive
        return np.concatenate([sines @ force, cosines @ force]) / (128 * STIFFNESS)

    omega = math.sqrt(STIFFNESS / MASS * (1 + 0.75 * cubic * amplitude**2))
    x = np.concatenate([[omega, DAMPING * omega * amplitude / STIFFNESS], np.zeros(8)])
    scale = np.concatenate([[omega, x[1]], np.full(8, amplitude)])
    for _ in range(20):
        steps = [1e-6 * size * np.eye(10)[n] for n, size in enumerate(scale)]
        jacobian = np.column_stack(
            [(residual(x + step) - residual(x - step)) / (2 * np.linalg.norm(step)) for step in steps]
        )
        x = x - np.linalg.solve(jacobian, residual(x))
    assert np.abs(residual(x)).max() < 1e-15
    return x[0] / (2 * math.pi), x[1]


def measured(
    vines: Path, folder: Path, rig: Oscillator, command: str, *settings: str
) -> subprocess.CompletedProcess[str]:
    words = [word for setting in settings for word in ("--set", setting)]
    with LockStepServer(rig) as address:
        return subprocess.run(
            [vines, command, "--rig", address, "--out", folder, *words], capture_output=True, text=True, check=False
        )


@pytest.mark.parametrize(("cubic", "phase"), [(HARDENING, -90.0), (-HARDENING, -90.0), (HARDENING, -80.0)])
def test_the_backbone_of_a_duffing_rig_is_that_of_harmonic_balance_and_told_without_a_particle(
    vines: Path, tmp_path: Path, cubic: float, phase: float
) -> None:
    done = measured(vines, tmp_path, Oscillator(cubic), "backbone", *LEVELS, f"controller.phase_target={phase}")
    assert done.returncode == 0, done.stderr
    said = done.stdout + done.stderr
    assert not [word for word in WORDS if word in said], said
    with (tmp_path / "tracked.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    for row in rows:
        assert row["settled"] == "true"
        assert (row["motion"], row["regime_by_impacts"]) == ("nonlinear, symmetric", "")
        assert float(row["phase_target_deg"]) == phase
        frequency, base = harmonic_balance(cubic, float(row["A_m"]), math.radians(phase))
        for name, expected in (("f_Hz", frequency), ("E_m", base)):
            off = float(row[name]) - expected
            # Without noise, what is left of a transient counts beside the resolution: one of these points is 3.2 u off.
            assert abs(off) < 4 * float(row[f"u_{name}"]), (name, float(row[name]), expected, row[f"u_{name}"])
        assert abs(float(row["f_Hz"]) / frequency - 1) < 1e-4
        assert abs(float(row["E_m"]) / base - 1) < 5e-3


def test_a_lock_and_decay_of_a_duffing_rig_are_told_without_a_particle(vines: Path, tmp_path: Path) -> None:
    done = measured(vines, tmp_path, Oscillator(HARDENING), "identify", "resonance.sensor=q1", "excitation.G=0.7")
    assert done.returncode == 0, done.stderr
    said = done.stdout + done.stderr
    assert "nonlinear, symmetric" in done.stdout, said
    assert " points from " in done.stdout, said
    assert not [word for word in WORDS if word in said], said


def test_a_linear_rig_is_told_as_near_its_linear_response(vines: Path, tmp_path: Path) -> None:
    done = measured(vines, tmp_path, Oscillator(0.0), "backbone", *LEVELS)
    said = done.stdout + done.stderr
    assert (done.returncode, said.count("near the linear response")) == (1, 5), said
    assert not [word for word in WORDS if word in said], said
