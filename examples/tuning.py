# %% [markdown]
# # A loop tuned against noise
# Error of the locked detuning and periods to the lock, over the bandwidth of the detector.

# %%
from concurrent.futures import ThreadPoolExecutor

import matplotlib.pyplot as plt
import numpy as np

import vines

plt.style.use("vines.figures")
bandwidths = np.geomspace(0.03, 0.3, 6)
seeds = range(1, 7)


def locked(bandwidth: float, seed: int) -> tuple[float, float]:
    """Return the error of sigma and the periods to the lock; NaN without a lock."""
    scene = vines.Scene(
        controller={"bandwidth": bandwidth},
        phase_lock={"lock.frequency_drift": 9e-6, "lock.amplitude_drift": 3e-4, "lock.phase_tolerance": 0.0873},
        chain={"snr": 30.0, "seed": seed},
        record={"decay_periods": 5.0},
    )
    try:
        lock = vines.identify(scene).lock
    except RuntimeError:
        return np.nan, np.nan
    # The motion belongs to the drive that is measured.
    driven = vines.orbits(vines.Scene(excitation={"G": lock["G"]}))
    return lock["sigma"] - next(orbit.sigma for orbit in driven if orbit.stable), lock["periods_to_lock"]


# %% [markdown]
# The interpreter lock is released: threads use all cores.

# %%
with ThreadPoolExecutor() as pool:
    found = pool.map(lambda case: locked(*case), [(bandwidth, seed) for bandwidth in bandwidths for seed in seeds])
    errors, periods = np.array(list(found)).reshape(len(bandwidths), len(seeds), 2).transpose(2, 0, 1)

# %%
figure, (upper, lower) = plt.subplots(2, sharex=True, figsize=(7.9, 5))
upper.loglog(bandwidths, np.abs(errors), ".", color="C5")
upper.loglog(bandwidths, np.sqrt(np.nanmean(errors**2, axis=1)), label="RMS")
upper.set(ylabel="|error of $\\sigma$|", title="Noise 30 dB below the response")
upper.legend()
lower.semilogx(bandwidths, periods, ".", color="C5")
lower.set(xlabel="bandwidth / ω₀", ylabel="periods to the lock")
figure.savefig("tuning.svg", metadata={"Date": None})
