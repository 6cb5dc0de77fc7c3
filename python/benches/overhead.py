"""What Python adds to a product, and what a block saves: ratios, which hardly depend on the machine.

`python python/benches/overhead.py [SCENE ...]`

A product is `A @ x` at 128×128 pixels. In Python it checks `x`, makes a new array, and frees it; in Rust, on the same
thread and for the same operator, it makes and frees a vector. Other work on the machine adds time to some products, and
moves others: so each product of Python has one of Rust beside it, in turns before and after it, and the median of their
differences is held against the median of Rust's.
"""

import sys
import time

import numpy as np

import krylux

SCENES = ["zigzag", "cornell", "corner"]


def seconds(work):
    """The seconds that a call takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def overhead(one, other, pairs):
    """``(median seconds of other, 1 + median difference over it)`` of two functions that return seconds."""
    differences, others = [], []
    for pair in range(pairs):
        if pair % 2:
            mine = one()
            theirs = other()
        else:
            theirs = other()
            mine = one()
        differences.append(mine - theirs)
        others.append(theirs)
    typical = float(np.median(others))
    return typical, 1 + float(np.median(differences)) / typical


def measure(scene, side=128, pairs=400):
    """The time of a product in Python over that in Rust, and of a block of eight over eight single products."""
    with krylux.open(f"assets/scenes/{scene}/scene.glb", size=side, progress=False) as lab:
        A, entries = lab.operator("global"), lab.matrix("global").nnz
        X = np.asfortranarray(np.random.default_rng(0).standard_normal((A.shape[1], 8)))
        x = X[:, 0].copy()
        rust, ratio = overhead(lambda: seconds(lambda: A @ x), lambda: A._native.seconds(x, 1), pairs)
        _, block = overhead(lambda: seconds(lambda: A @ X), lambda: seconds(lambda: [A @ X[:, k] for k in range(8)]),
                            pairs // 10)
    return {
        "entries": entries,
        "rust_seconds": rust,
        "python_over_rust": ratio,
        "block_over_singles": block,
    }


if __name__ == "__main__":
    for scene in sys.argv[1:] or SCENES:
        print(scene)
        for name, value in measure(scene).items():
            print(f"  {name:20} {value:.4g}")
