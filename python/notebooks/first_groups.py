# %% [markdown]
# # First groups in five lines
#
# A scene of two halves that exchange no light. Fifty photos tell which pixels belong together.

# %%
import krylux

lab = krylux.open("assets/scenes/zigzag/scene.glb", size=48, spp=64)
groups = lab.segment(groups=[2])
groups

# %% [markdown]
# The answer holds arrays. The scene's author labelled the halves; the adjusted Rand index is 1 where both agree.

# %%
print(groups.labels[2].shape, groups.eigenvalues[:3].round(4), groups.rand_index)
assert groups.rand_index[2] > 0.95

# %% [markdown]
# The light transport is a SciPy operator, and each product with it is one photo.

# %%
import scipy.sparse.linalg

global_light = lab.operator("global")
values, vectors = scipy.sparse.linalg.eigsh(global_light, k=4)
print(values, "from", global_light.photos, "photos")

# %% [markdown]
# krylux's own Lanczos stops earlier, because it knows that photos are dear.

# %%
pairs = lab.eigs(4, part="global", tolerance=1e-4)
print(pairs.values, "from", pairs.photos, "photos")
assert pairs.photos < global_light.photos
pairs
