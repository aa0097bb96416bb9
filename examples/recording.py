# %% [markdown]
# # From a recording to a rig
# A rig with unknown numbers is recorded while a loop holds one drive after another; the fit finds its numbers.

# %%
import matplotlib.pyplot as plt
import numpy as np

import vines

plt.style.use("vines.figures")
truth = {"M": 3.807, "k": 11.68e3, "c": 2.9, "m": 0.035, "b": 0.0095, "r": 0.57}
plant, lock = vines.Plant(truth, dq2=0.5), vines.PhaseLock()
output, response, base = lock.sample(plant.v, plant.base), [], []
for drive in np.repeat([1.5, 1.35, 1.25, 1.15], 20_000):
    plant.advance(lock.sample_time, amplitude=drive / 1.1 * output.amplitude, omega=output.omega)
    response.append(plant.v)
    base.append(plant.base)
    output = lock.sample(plant.v, plant.base)

# %% [markdown]
# The sensors have noise of 0.3 % of their signals. `vines.read_recording` reads such channels from CSV, MAT, HDF5,
# TDMS, UFF58 and LVM. The scene says what the sensor reads: here v, which is known of a simulation only.

# %%
random = np.random.default_rng(1)
noisy = [np.array(one) + 0.003 * np.std(one) * random.normal(size=len(one)) for one in (response, base)]
recording = vines.Recording("rig", ("response", "base"), lock.sample_time, *noisy, 0.0)
fit = vines.fit_recordings(recording, vines.Scene(resonance={"sensor": "v"}))
true = {"r": truth["r"], "b": truth["b"], "epsilon": truth["m"] / truth["M"]}
for symbol, value in true.items():
    print(f"{symbol:8} {fit[symbol][0]:.5f} ± {fit[symbol][1]:.1e}, true {value:.5f}")
print("chi-square", round(fit.chi_square), "for", fit.degrees, "degrees of freedom")

# %%
names = list(fit.parameters["symbol"])
values, uncertainties = fit.parameters["value"], fit.parameters["uncertainty"]
figure, (left, right) = plt.subplots(1, 2, figsize=(7.9, 3.6), width_ratios=(2, 1))
left.plot(1e3 * np.abs(noisy[0]).reshape(-1, 100).max(axis=1))
left.set(xlabel="time, periods", ylabel="peak of the response, mm", title="The recording")
for place, (symbol, value) in enumerate(true.items()):
    n = names.index(symbol)
    right.errorbar(place, values[n] / value - 1, 2 * uncertainties[n] / value, fmt="o", color="C1")
right.axhline(0, color="C5", lw=0.75)
right.set_xticks(range(3), list(true))
right.set(ylabel="fitted over true, less 1", xlim=(-0.5, 2.5), title="The fit, 95 %")
figure.savefig("recording.svg", metadata={"Date": None})
