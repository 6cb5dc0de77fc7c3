"""Residual histories, eigenvalues and product counts of SciPy on the matrices SCENE_16_*.npz: python3 make_scipy.py

The matrices were written by `krylux matrix assets/scenes/SCENE/scene.glb --size 16 --spp 64 --part global` (and direct;
24 samples for cornell), A = direct + global. The right-hand side is b_i = ((7919 i) mod 1009) / 1009.
"""

import json

import numpy as np
import scipy
from scipy.sparse import diags_array, load_npz
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, cg, eigsh, gmres, minres

STEPS = 30
COUNT = 6


def histories(A, b):
    """|b - A x_k| / |b| after k = 1, 2, … products, taken anew for each iterate."""
    relative = lambda x: float(np.linalg.norm(b - A @ x) / np.linalg.norm(b))

    def by_callback(solver):
        rows = []
        solver(A, b, rtol=0, maxiter=STEPS, callback=lambda x: rows.append(relative(x)))
        return rows

    # GMRES shows its iterate at the end of a cycle only: a cycle of each length, from the start.
    of_gmres = [relative(gmres(A, b, rtol=0, restart=k, maxiter=1)[0]) for k in range(1, STEPS + 1)]
    return {"minres": by_callback(minres), "cg": by_callback(cg), "gmres": of_gmres}


def spectrum(A):
    """The largest eigenvalues, by LAPACK, and what ARPACK took for them to a relative 1e-8."""
    n = A.shape[0]
    dense = np.linalg.eigvalsh(A.toarray())[::-1][:COUNT]
    products = 0

    def apply(x):
        nonlocal products
        products += 1
        return A @ x.ravel()

    operator = LinearOperator(A.shape, matvec=apply, dtype=float)
    start = np.random.default_rng(0).choice([-1.0, 1.0], n)
    values = np.sort(eigsh(operator, k=COUNT, which="LA", tol=1e-8, v0=start)[0])[::-1]
    taken, products = products, 0
    try:
        eigsh(operator, k=COUNT, which="LA", tol=1e-8, v0=start, ncv=50, maxiter=1)
        once = "converged"
    except ArpackNoConvergence:
        once = "ArpackNoConvergence"
    return {
        "eigenvalues": dense.tolist(),
        "eigsh": values.tolist(),
        "eigsh_products": taken,
        "eigsh_ncv50_maxiter1": [once, products],
    }


def main():
    found = {"scipy": scipy.__version__, "scenes": {}}
    for scene in ["corner", "zigzag", "cornell"]:
        G = load_npz(f"{scene}_16_global.npz").astype(float)
        A = (G + load_npz(f"{scene}_16_direct.npz").astype(float)).tocsr()
        n = A.shape[0]
        b = ((7919 * np.arange(n)) % 1009) / 1009
        scale = diags_array(1 / np.sqrt(G @ np.ones(n)))
        found["scenes"][scene] = {
            "histories": histories(A, b),
            "full": spectrum(A),
            "cut": spectrum((scale @ G @ scale).tocsr()),
        }
    with open("scipy_16.json", "w") as file:
        json.dump(found, file, indent=1)
        file.write("\n")


main()
