"""From the arguments of :func:`krylux.open` to what the native part opens."""

import os

from . import _checks, _progress

#: What :func:`krylux.open` takes beside the source, with its defaults.
DEFAULTS = {
    "size": None,
    "projector_size": None,
    "spp": None,
    "max_bounces": None,
    "seed": None,
    "sampler": None,
    "russian_roulette": False,
    "channels": "luma",
    "camera": None,
    "camera_file": None,
    "auto_camera": False,
    "strict": False,
    "allow_programs": False,
    "adapter": None,
    "cache": None,
    "operator": "auto",
    "products": "auto",
    "memory": None,
    "split_bounces": False,
    "folder": None,
    "resume": False,
    "overwrite": False,
    "progress": None,
    "name": None,
}


def request(source, options):
    """The dictionary that the native part opens; ``options`` has the keys of :data:`DEFAULTS`."""
    asked = dict(options)
    name = asked.pop("name")
    asked["size"] = _checks.size(asked["size"], "size")
    asked["projector_size"] = _checks.size(asked["projector_size"], "projector_size")
    for option in ("spp", "max_bounces"):
        if asked[option] is not None:
            asked[option] = _checks.count(asked[option], option)
    if asked["seed"] is not None:
        asked["seed"] = _checks.count(asked["seed"], "seed", 0, 2**32 - 1)
    if asked["memory"] is not None:
        asked["memory"] = _checks.count(asked["memory"], "memory", 0, 2**64 - 1)
    cache = asked.pop("cache")
    asked["cached"] = cache is not False
    asked["cache"] = None if cache in (None, True, False) else os.fspath(cache)
    for option in ("folder", "camera_file"):
        if asked[option] is not None:
            asked[option] = os.fspath(asked[option])
    asked.update(progress=_progress.choose(asked["progress"]), log=_progress.log)
    asked.update(matrix=None, rig=None, devices=None)
    asked.update(_source(source, name))
    return asked


def _source(source, name):
    from ._program import ProgramRig

    if isinstance(source, ProgramRig):
        return source._request(name)
    if isinstance(source, (str, os.PathLike)):
        path = os.fspath(source)
        if not os.path.exists(path):
            raise _checks.refuse("source", f"there is no file or folder {path!r}",
                                 "give a scene (.glb, .gltf, .obj), a rig file (.toml), a run folder, or a matrix")
        return {"source": path}
    return {"source": name or "matrix", "matrix": _matrix(source)}


def _matrix(source):
    """``(cols, data, indices, indptr)`` of a sparse or dense matrix."""
    import numpy as np
    import scipy.sparse

    if not scipy.sparse.issparse(source):
        dense = _checks.real_array(source, "source", np.float64)
        if dense.ndim != 2:
            raise _checks.refuse("source", f"its shape is {dense.shape}", "give a matrix, a path or a rig")
        source = scipy.sparse.csr_array(dense)
    matrix = scipy.sparse.csr_array(source)
    _checks.real_array(matrix.data, "source", np.float64)
    if not matrix.has_canonical_format:
        matrix = matrix.copy()
        matrix.sum_duplicates()
    arrays = (matrix.data.astype(np.float64), matrix.indices.astype(np.int64), matrix.indptr.astype(np.int64))
    return (matrix.shape[1], *arrays)
