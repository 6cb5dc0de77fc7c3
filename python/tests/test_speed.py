"""What Python adds to a product, as ratios; and what a sweep over workers must not change."""

import os
import sys

import numpy as np
import pytest

from conftest import ROOT


def module(folder, name):
    """A script of this repository as a module."""
    import importlib.util

    spec = importlib.util.spec_from_file_location(name, ROOT / "python" / folder / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[name] = loaded
    spec.loader.exec_module(loaded)
    return loaded


def test_a_product_costs_what_it_costs_in_rust_and_a_block_less(monkeypatch):
    monkeypatch.chdir(ROOT)
    overhead, ratios = module("benches", "overhead"), []
    # Other work on the machine only adds to a ratio or takes from it at random: the median of several decides.
    for _ in range(5):
        ratios.append(overhead.measure("cornell", 128, 30))
    assert np.median([one["python_over_rust"] for one in ratios]) <= 1.05, ratios
    assert np.median([one["block_over_singles"] for one in ratios]) < 0.8, ratios


def test_a_sweep_on_the_workers_of_dask_equals_the_serial_one(monkeypatch, tmp_path):
    distributed = pytest.importorskip("dask.distributed")
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "python" / "notebooks"), prepend=os.pathsep)
    monkeypatch.syspath_prepend(str(ROOT / "python" / "notebooks"))
    import sweep_with_dask

    values = [2, 4]
    serial = [sweep_with_dask.largest_eigenvalue(bounces) for bounces in values]
    assert serial[0] != serial[1]
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None,
                                  local_directory=tmp_path) as cluster, distributed.Client(cluster) as client:
        swept = client.gather(client.map(sweep_with_dask.largest_eigenvalue, values))
        # A laboratory itself travels as its settings.
        import krylux

        lab = krylux.open("assets/scenes/zigzag/scene.glb", size=12, spp=8, progress=False)
        white = client.submit(lambda lab: lab.white, lab).result()
    assert np.array_equal(serial, swept) and np.array_equal(white, lab.white)
