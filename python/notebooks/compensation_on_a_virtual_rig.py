# %% [markdown]
# # Compensation on a virtual rig
#
# What must be projected, so that a folded wall looks evenly bright? The devices are simulated, with noise, a
# projector of 8 bits, and a camera of its own response.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import krylux

folder = Path(tempfile.mkdtemp())
rig = "assets/rigs/realistic.toml"

# %% [markdown]
# The devices are calibrated from captures alone.

# %%
calibrated = krylux.rig.calibrate(rig, folder / "calibration", size=32, spp=64)
print("\n".join(calibrated.lines))

# %% [markdown]
# A matte sheet before the rig tells how uneven projector and camera are.

# %%
# The rig file with the calibration beside it, in a folder of its own.
settings = Path(rig).read_text().replace("../", f"{Path('assets').resolve()}/")
own = folder / "rig.toml"
own.write_text('calibration = "calibration"\n' + settings)
uneven = krylux.rig.flat_field(own, size=32, spp=64)
print(f"darkest over brightest: projector {uneven.projector.min() / uneven.projector.max():.3f}, "
      f"camera {uneven.camera.min() / uneven.camera.max():.3f}")

# %% [markdown]
# Every photo of the run is in its journal before it is used.

# %%
lab = krylux.open(own, size=32, spp=64, folder=folder / "run")
target = np.full(lab.shape, 0.6)
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
# The run's folder holds the pattern to project, the report, and all photos: it answers again without the rig.

# %%
print(sorted(file.name for file in found.save().iterdir())[:6])
lab.close()
replay = krylux.open(folder / "run")
print(replay.kind, replay.unit)
