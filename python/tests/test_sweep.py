"""What a sweep over workers must not change."""

import os

import numpy as np
import pytest

from conftest import ROOT


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
