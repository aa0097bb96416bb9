"""A sample loop, as users write it for a controller of their own: this package against the FMU in FMPy.

scripts/python; .venv-python/bin/python benchmarks/python/sample_loop.py

Both advance the same motion sample by sample and read what a controller needs. Turns alternate; figures are medians.
"""

import statistics
import time

from fmpy import extract, instantiate_fmu, read_model_description

import vines

SAMPLES, TURNS, STEP = 5_000, 41, 2.0**-10
DRIVE = vines.Scene().drive(sigma=-1.1)


def package():
    """Return a turn with `Plant.advance` and two attributes, and one with `states`."""
    plant = vines.Plant(dq2=0.5)

    def attributes():
        for _ in range(SAMPLES):
            plant.advance(STEP, **DRIVE)
            plant.v, plant.base  # noqa: B018  what is measured

    def states():
        for _ in range(SAMPLES):
            plant.advance(STEP, **DRIVE)
            plant.states  # noqa: B018

    return attributes, states


def fmu():
    """Return a turn of FMPy: set the drive, do a step, get two outputs."""
    path = vines.fmu("LoViNes")
    description = read_model_description(path)
    numbers = {one.name: one.valueReference for one in description.modelVariables}
    instance = instantiate_fmu(extract(path), description, "CoSimulation")
    instance.setupExperiment(startTime=0.0)
    start = vines.Scene().settings["plant"] | {"der(q2)": 0.5}
    instance.setReal([numbers[name] for name in start], list(start.values()))
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    drive, outputs = [numbers["E"], numbers["omega"]], [numbers["v"], numbers["base"]]
    given, now = list(DRIVE.values()), [0]

    def turn():
        for _ in range(SAMPLES):
            instance.setReal(drive, given)
            instance.doStep(now[0] * STEP, STEP)
            now[0] += 1
            instance.getReal(outputs)

    return turn


def main():
    attributes, states = package()
    methods = {"Plant.advance, v, base": attributes, "Plant.advance, states": states, "FMPy: set, step, get": fmu()}
    times = {name: [] for name in methods}
    for _ in range(TURNS):
        for name, turn in methods.items():
            begin = time.perf_counter()
            turn()
            times[name].append((time.perf_counter() - begin) / SAMPLES * 1e6)
    reference = times["FMPy: set, step, get"]
    print("loop                      microseconds per sample    FMPy over it (quartiles)")
    for name, own in times.items():
        ratio = statistics.quantiles([other / one for other, one in zip(reference, own, strict=True)])
        print(f"{name:26}{statistics.median(own):14.2f}{ratio[1]:20.1f} ({ratio[0]:.1f} to {ratio[2]:.1f})")


main()
