"""What Python adds to a product, and what a block saves: ratios, which hardly depend on the machine.

`python python/benches/overhead.py [SCENE ...]`

The lower quartiles of many repetitions are compared, taken in turns: other work on the machine adds time to some of them.
"""

import sys
import time

import numpy as np

import krylux


def seconds(work):
    """The seconds that a call takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def quartile(times):
    """The time below which a quarter of them are."""
    return float(np.quantile(times, 0.25))


def measure(scene="cornell", side=128, rounds=40):
    """The time of a product in Python over that in Rust, and of a block of eight over eight single products."""
    with krylux.open(f"assets/scenes/{scene}/scene.glb", size=side, progress=False) as lab:
        A, entries = lab.operator("global"), lab.matrix("global").nnz
        X = np.asfortranarray(np.random.default_rng(0).standard_normal((A.shape[1], 8)))
        x = X[:, 0].copy()
        python, rust, block, singles = [], [], [], []
        for _ in range(rounds):
            for _ in range(4):
                python.append(seconds(lambda: A @ x))
                rust.append(A._native.seconds(x, 1))
            block.append(seconds(lambda: A @ X))
            singles.append(seconds(lambda: [A @ X[:, column] for column in range(8)]))
    return {
        "entries": entries,
        "rust_seconds": quartile(rust),
        "python_over_rust": quartile(python) / quartile(rust),
        "block_over_singles": quartile(block) / quartile(singles),
    }


if __name__ == "__main__":
    for scene in sys.argv[1:] or ["cornell", "zigzag"]:
        print(scene)
        for name, value in measure(scene).items():
            print(f"  {name:20} {value:.4g}")
