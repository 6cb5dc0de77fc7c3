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


@pytest.mark.parametrize("scene", ["zigzag", "cornell", "corner"])
def test_a_product_costs_what_it_costs_in_rust_and_a_block_less(monkeypatch, scene):
    monkeypatch.chdir(ROOT)
    found = module("benches", "overhead").measure(scene)
    print(scene, found)
    assert found["python_over_rust"] <= 1.05, found
    assert found["block_over_singles"] < 0.9, found


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
