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

    values = [0.25, 0.75]
    serial = [sweep_with_dask.largest_eigenvalue(albedo) for albedo in values]
    assert 0 < serial[0] < serial[1]
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None,
                                  local_directory=tmp_path) as cluster, distributed.Client(cluster) as client:
        swept = client.gather(client.map(sweep_with_dask.largest_eigenvalue, values))
        # A laboratory itself travels as its settings.
        import krylux

        lab = krylux.open("assets/scenes/zigzag/scene.glb", size=12, spp=8, progress=False)
        white = client.submit(lambda lab: lab.white, lab).result()
        # A scene, and a laboratory around one, travel as the parameters that they have now.
        scene = krylux.Scene.load("assets/scenes/zigzag/scene.glb")
        own = krylux.open(scene, size=12, spp=8, progress=False)
        scene.params["white paper.albedo"] = 0.1
        same = client.submit(lambda lab: lab.white, own).result()
        changed = client.submit(lambda scene: scene.params["white paper.albedo"], scene).result()
    assert np.array_equal(white, same) and np.array_equal(changed, scene.params["white paper.albedo"])
    assert np.array_equal(serial, swept) and np.array_equal(white, lab.white)
