# %% [markdown]
# # Fifty photos: Krylov in your own code
#
# A Lanczos process, written by hand on the operator: show a pattern, take its photo, make the photo orthogonal to all
# earlier patterns, and show it next. The recursion is in section 4 of O'Toole and Kutulakos, *Light Transport Analysis
# by Krylov Subspace Illumination*, and the orthogonalization in section 7.1. For the process itself they call MATLAB's
# `eigs` (section 8.1).

# %%
import matplotlib.pyplot as plt
import numpy as np
import scipy.linalg

import krylux

lab = krylux.open("assets/scenes/zigzag/scene.glb", size=32, spp=64)
A = lab.operator("global")
n = A.shape[0]


def lanczos(A, photos):
    """The tridiagonal matrix ``(α, β)`` and the patterns ``[n, photos]`` of so many photos."""
    patterns = [np.ones(n) / np.sqrt(n)]
    alphas, betas = [], []
    for _ in range(photos):
        photo = A @ patterns[-1]
        alphas.append(patterns[-1] @ photo)
        # Twice is enough: rounding leaves a little of each earlier pattern after the first time.
        for _ in range(2):
            basis = np.stack(patterns, axis=1)
            photo = photo - basis @ (basis.T @ photo)
        betas.append(np.linalg.norm(photo))
        patterns.append(photo / betas[-1])
    return np.array(alphas), np.array(betas), np.stack(patterns[:-1], axis=1)


alphas, betas, patterns = lanczos(A, 50)
values, coordinates = scipy.linalg.eigh_tridiagonal(alphas, betas[:-1])
vectors = patterns @ coordinates
print(A.photos, "photos; the largest eigenvalues are", values[::-1][:4])

# %% [markdown]
# The matrix itself is at hand here, so that the answer can be compared with the exact one. The residual is known
# without it: it is `β` times the last coordinate.

# %%
exact = np.linalg.eigvalsh(lab.matrix("global").toarray())[::-1]
residuals = betas[-1] * np.abs(coordinates[-1])
for index in range(3):
    print(f"{values[-1 - index]:.6f}  exact {exact[index]:.6f}  within {residuals[-1 - index]:.1e}")
    assert np.abs(exact - values[-1 - index]).min() <= residuals[-1 - index] + 1e-9

# %%
figure, axes = plt.subplots(1, 4, figsize=(10, 2.6))
for index, axis in enumerate(axes):
    picture = vectors[:, -1 - index].reshape(lab.shape)
    axis.imshow(picture, cmap="RdBu", vmin=-abs(picture).max(), vmax=abs(picture).max())
    axis.set(title=f"{values[-1 - index]:.4f}", xticks=[], yticks=[])
figure.tight_layout()

# %% [markdown]
# One start finds a repeated eigenvalue once: the two halves of this scene have nearly equal ones. A block of starts
# finds both, and its products cost less each, because they share a pass over the matrix.

# %%
block = lab.eigs(4, part="global", method="block-lanczos", block=2, photos=50)
print(block.values)
