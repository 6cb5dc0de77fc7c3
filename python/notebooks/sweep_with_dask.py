"""One number of a scene over many values of a parameter, on the workers of `dask.distributed`.

`python python/notebooks/sweep_with_dask.py`

Each worker opens the scene itself; a laboratory travels as its settings. The answers are equal to the serial ones to
the last bit, because nothing in krylux depends on the number of threads.
"""

import numpy as np

import krylux


def largest_eigenvalue(bounces, scene="assets/scenes/zigzag/scene.glb"):
    """The largest eigenvalue of the global light when a path meets at most so many surfaces."""
    with krylux.open(scene, size=24, spp=32, max_bounces=bounces, cache=False, progress=False) as lab:
        return lab.eigs(1, part="global", photos=30).values[0]


def main():
    from dask.distributed import Client, LocalCluster

    values = list(range(2, 7))
    serial = [largest_eigenvalue(bounces) for bounces in values]
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        swept = client.gather(client.map(largest_eigenvalue, values))
    assert np.array_equal(serial, swept), "equal to the last bit"
    for bounces, value in zip(values, swept):
        print(f"{bounces} bounces: {value:.8f}")


if __name__ == "__main__":
    main()
