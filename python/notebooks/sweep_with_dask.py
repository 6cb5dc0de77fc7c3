"""One number of a scene over many albedos, on the workers of `dask.distributed`: `python python/notebooks/sweep_with_dask.py`

A scene travels to the workers as its parameters. The answers equal the serial ones to the last bit.
"""

import krylux

scene = krylux.Scene.load("assets/scenes/zigzag/scene.glb")


def largest_eigenvalue(albedo):
    scene.params["white paper.albedo"] = albedo
    with krylux.open(scene, size=24, spp=32, cache=False, progress=False) as lab:
        return lab.eigs(1, part="global", photos=30).values[0]


if __name__ == "__main__":
    from dask.distributed import Client

    with Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
        albedos = [step / 20 for step in range(1, 20)]
        for albedo, value in zip(albedos, client.gather(client.map(largest_eigenvalue, albedos))):
            print(f"albedo {albedo:.2f}: {value:.8f}")
