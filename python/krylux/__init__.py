"""krylux: a light transport laboratory.

A projector lights a scene, a camera takes the photo, the photo is projected back, and so on. These photos span the
Krylov subspace of the scene's light transport matrix ``A`` (photo = ``A`` · pattern), so that its eigenvectors, and
what follows from them, are computed from a few dozen photos.

Examples:
    >>> import krylux
    >>> lab = krylux.open("assets/scenes/zigzag/scene.glb", size=64)        # doctest: +SKIP
    >>> groups = lab.segment(groups=[2])                                    # doctest: +SKIP
    >>> A = lab.operator("global")                                          # doctest: +SKIP
    >>> scipy.sparse.linalg.eigsh(A, k=4, tol=1e-3)                         # doctest: +SKIP

The package answers from matrices and from the folders of earlier runs on any machine; scenes need a Vulkan driver, which
may be a software driver. Nothing is loaded before it is needed: ``import krylux`` does not touch Vulkan, and SciPy is
imported with the first matrix or operator.

References: O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*.
"""

from typing import TYPE_CHECKING

from . import errors as errors
from ._krylux import __version__ as __version__
from .errors import Error as Error

__all__ = [
    "Error", "Lab", "LabOperator", "Scene", "__version__", "answers", "captures", "compare", "errors", "images", "import_captures",
    "krylov", "open", "paper", "reproduce", "rig",
]

if TYPE_CHECKING:
    from . import answers, captures as captures, images, krylov, lab as lab, operator as operator, paper, rig, scene as scene
    from .captures import import_captures
    from .images import compare
    from .lab import Lab, open
    from .operator import LabOperator
    from .paper import reproduce
    from .scene import Scene
else:
    #: Where each name is found, when it is first asked for.
    _PLACES = {
        "Lab": "lab", "open": "lab", "LabOperator": "operator", "Scene": "scene", "compare": "images",
        "import_captures": "captures",
        "reproduce": "paper",
    }

    def __getattr__(name):
        import importlib

        if name in _PLACES:
            return getattr(importlib.import_module(f".{_PLACES[name]}", __name__), name)
        if name in ("answers", "captures", "images", "krylov", "lab", "operator", "paper", "rig", "scene"):
            return importlib.import_module(f".{name}", __name__)
        raise AttributeError(f"module 'krylux' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
