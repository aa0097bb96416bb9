# %% [markdown]
# # First lock
# The loop locks the plant at phase resonance, holds it, and lets it go: the free decay follows the backbone.

# %%
import matplotlib.pyplot as plt

import vines

plt.style.use("vines.figures")
found = vines.identify()
lock, exact = found.lock, found.exact
for name in ("sigma", "C", "B"):
    print(f"{name:5}  {lock[name]:.6f} ± {lock['u_' + name]:.1e}, exact orbit {getattr(exact, name):.6f}")
print("motion:", lock["motion"])

# %% [markdown]
# The decay lies left of both curves: it is not a steady motion, and its impacts follow late. The exact plant, released
# from the exact orbit, decays alike.

# %%
axes = found.plot()
decay = found.decay
axes.plot(decay["sigma_slow_flow"], decay["C"], label="decay of the slow flow")
axes.set(xlim=(-2, 0), ylim=(0, 0.6), title="The free decay beside the backbone")
axes.legend()
axes.figure.savefig("first_lock.svg", metadata={"Date": None})
