"""What Python adds to a product, and what a block saves: ratios, which hardly depend on the machine.

`python python/benches/overhead.py [SCENE ...]`

The least of many repetitions is compared, taken in turns, because other work on the machine only ever adds time.
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


def measure(scene="cornell", side=128, rounds=40):
    """The time of a product in Python over that in Rust, and of a block of eight over eight single products."""
    with krylux.open(f"assets/scenes/{scene}/scene.glb", size=side, progress=False) as lab:
        A, entries = lab.operator("global"), lab.matrix("global").nnz
        X = np.asfortranarray(np.random.default_rng(0).standard_normal((A.shape[1], 8)))
        x = X[:, 0].copy()
        python, rust, block, singles = [], [], [], []
        for _ in range(rounds):
            python.append(seconds(lambda: A @ x))
            rust.append(A._native.seconds(x, 1))
            block.append(seconds(lambda: A @ X))
            singles.append(seconds(lambda: [A @ X[:, column] for column in range(8)]))
    return {
        "entries": entries,
        "rust_seconds": min(rust),
        "python_over_rust": min(python) / min(rust),
        "block_over_singles": min(block) / min(singles),
    }


if __name__ == "__main__":
    for scene in sys.argv[1:] or ["cornell", "zigzag"]:
        print(scene)
        for name, value in measure(scene).items():
            print(f"  {name:20} {value:.4g}")
