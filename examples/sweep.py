# %% [markdown]
# # A sweep on Dask
# Basins of attraction: from which starts of the primary mass, with the particle at rest, impacts begin and persist.

# %%
import matplotlib.pyplot as plt
import numpy as np
from dask.distributed import Client, LocalCluster
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

import vines

plt.style.use("vines.figures")
COLOURS = {"no impacts": "#F6F6F4", "symmetric 1:1": "#B2D9F1", "asymmetric 1:1": "#F0B446", "n impacts": "#5AAE6E"}
COLOURS |= {"quasi-periodic": "#3C82A0", "modulated": "#BE462D", "chaotic": "#6A3480", "undecided": "#1E2028"}

# %% [markdown]
# While there is a client, the dataset is lazy: its chunks are computed by the workers. On a cluster only the client is
# another one. `store="starts.zarr"` would keep the chunks, and continue after an interruption.

# %%
scene = vines.Scene(start={"dq2": 0.0})
starts = {"start.q1": np.linspace(-0.0099, 0.0099, 61), "start.dq1": np.linspace(-0.6, 0.6, 61)}
with LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster, Client(cluster):
    cells = vines.sweep(scene, starts, periods=1000, chunks={"start.q1": 16}).compute()
counts = {name: int((cells.regime == code).sum()) for code, name in enumerate(vines.REGIMES)}
print({name: count for name, count in counts.items() if count})

# %%
figure, axes = plt.subplots(figsize=(7.9, 4.2))
colours = ListedColormap([COLOURS[name] for name in vines.REGIMES])
place = 1e3 * cells["start.q1"], cells["start.dq1"]
axes.pcolormesh(*place, cells.regime.T, cmap=colours, vmin=-0.5, vmax=len(COLOURS) - 0.5, rasterized=True)
patches = [Patch(facecolor=COLOURS[name], edgecolor="0.6", label=name) for name in vines.REGIMES if counts[name]]
figure.legend(handles=patches, loc="outside right upper")
axes.set(xlabel="displacement at the start, mm", ylabel="velocity at the start, m/s", title="Where each start leads")
figure.savefig("sweep.svg", metadata={"Date": None})
