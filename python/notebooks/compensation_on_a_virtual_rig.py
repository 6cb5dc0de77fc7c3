# %% [markdown]
# # Compensation on a virtual rig
#
# What must be projected, so that a folded wall looks evenly bright? The devices are simulated, with noise, a
# projector of 8 bits, and a camera of its own response. The scene is also looked at without devices, so that the answer
# can be held against the true light.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import krylux

folder = Path(tempfile.mkdtemp())
scene = krylux.open("assets/scenes/zigzag/scene.glb", size=32, spp=64)
lab = scene.through_rig("assets/rigs/realistic.toml", folder=folder / "run")
print(scene.unit, "and", lab.unit)

# %% [markdown]
# The devices are calibrated from captures alone. A matte sheet before the rig tells how uneven projector and camera
# are. For a rig on a bench, `krylux.rig.calibrate` and `krylux.rig.flat_field` write the same into a folder that the rig
# file names.

# %%
calibrated = lab.calibrate(flat_field=True)
print("\n".join(calibrated.lines))

# %% [markdown]
# What will twenty photos cost, and how good will the answer be? The twin of the rig tells, with noise of its own.

# %%
target = np.full(lab.shape, 0.6)
planned = lab.plan("compensate", target, photos=20, trials=2)
planned

# %% [markdown]
# Every photo of the run is in its journal before it is used.

# %%
found = lab.compensate(target, photos=20)
print(found.status)
print(f"residual {found.residual:.4f}, uncompensated {found.uncompensated_residual:.4f}")
assert found.residual < found.uncompensated_residual
found

# %%
figure, axis = plt.subplots(figsize=(5, 3))
axis.semilogy(np.arange(1, len(found.history) + 1), found.history, marker="o")
axis.set(xlabel="photos", ylabel="residual of what is seen")
figure.tight_layout()

# %% [markdown]
# How even is the true light, which no device disturbs?

# %%
for name, pattern in (("white", np.ones(scene.shape)), ("the pattern", found.pattern)):
    light = scene.photo(pattern)
    print(f"{name}: the light varies by {100 * light.std() / light.mean():.1f} % of its mean")

# %% [markdown]
# The run's folder holds the pattern to project, the report, and all photos: it answers again without the rig.

# %%
print(sorted(file.name for file in found.save().iterdir())[:6])
lab.close()
replay = krylux.open(folder / "run")
print(replay.kind, replay.unit)
