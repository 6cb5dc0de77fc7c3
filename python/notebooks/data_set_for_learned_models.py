# %% [markdown]
# # A data set of a thousand pairs for a learned projector-camera model
#
# Learned models of projection mapping are trained on pairs of a pattern and its photo. Their data sets share a layout,
# that of CompenNet and DeProCams: a folder for each setup, with `prj/train`, `prj/test` and `cam/raw/train`,
# `cam/raw/test`, where pictures of one number belong together, and `ref` holds plain colours.
#
# A virtual rig takes such pairs by the thousand, of any number of scenes, with the noise of its devices; and the true
# matrix is known as well.

# %%
import json
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import krylux

PAIRS = 1000
SIZE = 32
FOLDER = Path(os.environ.get("KRYLUX_DATA") or tempfile.mkdtemp())
SCENES = ["cornell", "carton"]


def patterns(count, size, seed):
    """Colourful random pictures with detail at all scales, in [0, 1], ``float32[H, W, 3]`` each."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        picture = np.zeros((size, size, 3))
        for side in (2, 4, 8, 16, size):
            blocks = random.random((side, side, 3))
            picture += np.kron(blocks, np.ones((size // side, size // side, 1))) / 5
        yield picture.astype(np.float32)


# %% [markdown]
# The devices: an office projector and a colour camera with noise. Every imperfection that a rig file describes can be
# added, such as ambient light or drift. By `response = false` levels and counts are used as they are, so that the
# projector's response is part of what a model has to learn.

# %%
RIG = """
kind = "virtual"
seed = {seed}

[scene]
file = "{scene}"
size = [{size}, {size}]
samples = 64

[projector]
bits = 8
channels = 3
gamma = 2.2
black_level = 0.002
vignetting = 0.1

[camera]
size = [{size}, {size}]
bits = 12
channels = 3
full_well = 20000
shot_noise = true
read_noise = 5
exposures = [1e-4, 5.0]

[measurement]
response = false
"""

# %% [markdown]
# One setup. The white photo sets the scale of the pictures, as an exposure would. Arrays keep the full depth; a picture
# library can turn them into PNG.


# %%
def write_setup(scene, folder, pairs, seed):
    """Writes the pairs of one scene, and what is known of it."""
    folder.mkdir(parents=True)
    rig = folder / "rig.toml"
    rig.write_text(RIG.format(scene=Path("assets/scenes").resolve() / scene / "scene.glb", size=SIZE, seed=seed))
    with krylux.open(rig, channels="native") as lab:
        white = lab.white
        for part, count, first in (("train", pairs * 4 // 5, 0), ("test", pairs - pairs * 4 // 5, 10**6)):
            shown, seen = folder / "prj" / part, folder / "cam" / "raw" / part
            shown.mkdir(parents=True)
            seen.mkdir(parents=True)
            for number, pattern in enumerate(patterns(count, SIZE, seed + first), start=1):
                np.save(shown / f"img_{number:04}.npy", pattern)
                np.save(seen / f"img_{number:04}.npy", lab.photo(pattern) / white.max())
        (folder / "cam" / "raw" / "ref").mkdir()
        np.save(folder / "cam" / "raw" / "ref" / "white.npy", white / white.max())
        np.save(folder / "cam" / "raw" / "ref" / "black.npy", lab.ambient / white.max())
        known = {"scene": scene, "seed": seed, "pairs": pairs, "unit": lab.unit, "white": float(white.max())}
        (folder / "setup.json").write_text(json.dumps(known, indent=1))


for number, scene in enumerate(SCENES):
    write_setup(scene, FOLDER / scene, PAIRS // len(SCENES), seed=number)

# %%
for scene in SCENES:
    files = sorted((FOLDER / scene / "prj" / "train").iterdir())
    print(scene, len(files), "training pairs, for example", files[0].name)
    assert len(files) == len(list((FOLDER / scene / "cam" / "raw" / "train").iterdir()))

# %%
figure, axes = plt.subplots(2, len(SCENES), figsize=(6, 6))
for column, scene in enumerate(SCENES):
    for row, place in enumerate(("prj/train", "cam/raw/train")):
        picture = np.load(FOLDER / scene / place / "img_0001.npy")
        axes[row, column].imshow(np.clip(picture, 0, 1) ** (1 / 2.2), cmap="gray")
        axes[row, column].set(title=f"{scene}: {place}", xticks=[], yticks=[])
figure.tight_layout()
