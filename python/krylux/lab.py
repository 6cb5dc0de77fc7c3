"""The laboratory: one door to a scene, a rig, the folder of an earlier run, or a matrix."""

from __future__ import annotations

import copy
import inspect
import os
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _declared, _display, _krylux, _progress, answers
from ._asking import Asking
from .scene import Scene

if TYPE_CHECKING:
    from scipy.sparse import csr_array as _csr_array

    from .operator import LabOperator as _LabOperator
    from .rig import ProgramRig as _ProgramRig, Report as _Report

    _Part = Literal["full", "direct", "global"]


class Lab(Asking):
    """An open laboratory. Obtain one by :func:`krylux.open`.

    Nothing is traced and no photo is taken before one is asked for. Threads may share a laboratory, and take turns. It
    can be pickled: the copy opens the same source with the same settings.

    Attributes:
        kind: ``"scene"``, ``"rig"``, ``"run"`` or ``"matrix"``.
        name: A short name, for folders and titles.
        shape, projector_shape: ``(height, width)`` of photos and of patterns. A matrix of ``n`` rows that came without sizes has ``(1, n)``.
        channels: 1 (gray) or 3.
        unit: The unit of photos: W/(m² sr) for scenes, DN/s for rigs.
        seed: Seeds starting vectors and other choices by chance outside of the tracer.
    """

    kind: Literal["scene", "rig", "run", "matrix"]
    name: str
    shape: tuple[int, int]
    projector_shape: tuple[int, int]
    channels: int
    unit: str
    seed: int

    def __init__(self, source: Any, options: dict[str, Any]) -> None:
        # A laboratory, and each copy of it, has the scene as it is now.
        self._source = source = copy.copy(source) if isinstance(source, Scene) else source
        self._options = options
        #: The rig files that the source is seen through, and whether its devices were calibrated since.
        self._rigs: tuple[str, ...] = ()
        self._is_calibrated = False
        self._hold(_krylux.Lab(request(source, options)))

    def _hold(self, native: _krylux.Lab) -> None:
        self._native = native
        self._matrices: weakref.WeakValueDictionary[tuple[str, int], _krylux.Matrix] = weakref.WeakValueDictionary()
        self.kind, self.name, self.shape, self.projector_shape, self.channels, self.unit, self.seed = native.describe()

    @overload
    def photo(self, pattern: ArrayLike | str, *, with_error: Literal[False] = False) -> NDArray[np.float32]: ...
    @overload
    def photo(
        self, pattern: ArrayLike | str, *, with_error: Literal[True]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]: ...
    def photo(self, pattern: ArrayLike | str, *, with_error: bool = False) -> Any:
        """Takes the photo of a pattern, with the ambient light.

        Args:
            pattern: ``[H, W]`` or ``[H, W, 3]`` of the projector's pixels, any real type and any strides. 1 stands for
                an irradiance of 1 W/m² on a plane at 1 m, or for the projector's full light. A gray pattern lights all
                channels. Or a name as on the command line: ``"white"``, ``"black"``, ``"left"``, ``"checker:8"``,
                ``"stripes:4"``, ``"pixel:10,20"``, or an image file.
            with_error: Return also the standard error of each sample, or ``None`` where it is not known.

        Returns: ``float32[H, W]`` or ``[H, W, 3]`` of the camera's pixels, in :attr:`unit`.

        Raises:
            krylux.errors.OptionError: The pattern has another shape, another type of data, or NaN, or no such name.
        """
        if isinstance(pattern, str):
            pattern = self._native.pattern(pattern)
        elif self.kind == "matrix":
            pattern = _checks.real_array(pattern, "pattern", np.float32)
            # A matrix that came without sizes takes a vector in any shape.
            is_vector = pattern.ndim == 1 or self.projector_shape[0] == 1
            if is_vector and pattern.size == self.projector_shape[0] * self.projector_shape[1]:
                pattern = pattern.reshape(self.projector_shape)
        pattern = _checks.picture(pattern, "pattern", self.projector_shape, self.channels)
        photo, error = self._native.photo(pattern, with_error)
        return (photo, error) if with_error else photo

    @property
    def white(self) -> NDArray[np.float32]:
        """The photo under an all-ones pattern, ``float32[H, W]`` or ``[H, W, 3]``."""
        return self._native.plain(True)

    @property
    def ambient(self) -> NDArray[np.float32]:
        """The photo without projector, ``float32[H, W]`` or ``[H, W, 3]``."""
        return self._native.plain(False)

    @property
    def noise(self) -> dict[str, Any] | None:
        """The noise of the traced matrix, or ``None`` where none is known.

        A dictionary: ``white`` ``float32[H, W]``, the standard errors of the white photo; ``white_relative``, ``operator``
        and ``global_``, relative errors of the white photo, of the matrix, and of its global part.
        """
        return self._native.noise()

    @property
    def is_symmetric(self) -> bool:
        """Whether the light transport matrix is symmetric: that of a coaxial rig."""
        return self._native.kind_of_light()[0]

    @property
    def is_simulated(self) -> bool:
        """Whether photos cost only computing, as for every source but a rig."""
        return self._native.kind_of_light()[1]

    @property
    def costs(self) -> dict[str, Any] | None:
        """The costs of a rig so far, as a dictionary; ``None`` for other sources."""
        return self._native.costs()

    def product_noise(self, part: str = "full") -> float | None:
        """The expected error of a product with a vector of norm 1, or ``None`` where no matrix was traced."""
        return self._native.product_noise(part)

    def labels(self) -> NDArray[np.uint8]:
        """The region that the centre of each pixel of a scene sees, ``uint8[H, W]``; 255 sees none."""
        return self._native.labels()

    def truth(self) -> tuple[NDArray[np.uint8], list[str]] | None:
        """The true labels of the scene's author.

        Returns: ``uint8[H, W]``, and the names of the regions; ``None`` where there are none.
        """
        return self._native.truth()

    def matrix(self, part: _Part = "full", *, channel: int = 0) -> _csr_array[np.float64]:
        """The light transport matrix itself, without a copy.

        Args:
            part: ``"full"``, ``"direct"`` or ``"global"`` light.
            channel: The channel, from 0.

        Returns: ``[pixels of a photo, pixels of a pattern]``, ``float64``. Its values and column indices are read-only views of krylux's
            own memory, which lives as long as one of them; matrices of one part and channel share it.

        Raises:
            krylux.errors.OptionError: The source takes photos, and has no matrix in memory.
        """
        import scipy.sparse

        key = (part, _checks.count(channel, "channel", 0))
        native = None if self.is_closed else self._matrices.get(key)
        if native is None:
            # A scene's matrix is in layers of single precision, which are put together once for as long as somebody uses the result.
            native = self._native.matrix(*key)
            self._matrices[key] = native
        data, indices, indptr = native.arrays()
        matrix = scipy.sparse.csr_array((data, indices, indptr), shape=native.shape, copy=False)
        # The columns ascend in each row: SciPy need not look, nor sort them in place.
        matrix.has_sorted_indices = True
        matrix.has_canonical_format = True
        return matrix

    def operator(self, part: _Part = "full", *, channel: int = 0) -> _LabOperator:
        """One part of the light transport as a linear operator; each product with it is one photo.

        Args:
            part: ``"full"``, ``"direct"`` or ``"global"`` light.
            channel: The channel, from 0.

        Returns: A :class:`scipy.sparse.linalg.LinearOperator`.
        """
        from .operator import LabOperator

        native = self._native.operator(part, _checks.count(channel, "channel", 0))
        return LabOperator(native, part, channel, self.shape, self.projector_shape)

    def singular(self, count: int = 6, *, part: _Part = "full", photos: int | None = None, tolerance: float | None = None,
                 confirm: float | None = None) -> answers.SingularTriplets:
        """Computes singular values of one part of the light transport matrix: :meth:`eigs` with ``singular=True``.

        References: Golub and Kahan, *Calculating the singular values and pseudo-inverse of a matrix*, 1965.
        """
        options = {"part": part, "photos": photos, "tolerance": tolerance, "confirm": confirm, "singular": True}
        return _declared.ask(self, "eigs", {"count": count, **options})

    def imported(self) -> answers.Imported:
        """How well the model of a folder of captures predicts photos that were left out."""
        return _declared.ask(self, "import", {})

    def solve(self, b: ArrayLike, *, method: str = "minres", photos: int = 50, rtol: float = 1e-6, lower: float = 0.0,
              upper: float = 1.0) -> answers.Solution:
        """Solves ``A x = b`` with the matrix of the first channel.

        Args:
            b: An entry for each pixel of a photo.
            method: A name of ``krylux solve --method``, such as ``"minres"``, ``"gmres"``, ``"lsqr"`` or
                ``"krylov-box"``.
            photos: Products to take at most.
            rtol: Done when ``‖b − A x‖ ≤ rtol ‖b‖``.
            lower, upper: The box of the methods that keep one.
        """
        options = {"method": method, "photos": photos, "rtol": rtol, "lower": lower, "upper": upper}
        rhs = _checks.vector(b, "b", self.shape[0] * self.shape[1])
        return _declared.ask(self, "solve", options, [("values", "", rhs)])

    def relight(self, patterns: Mapping[str, ArrayLike] | None = None, *, duals: Mapping[str, ArrayLike] | None = None,
                photographs: Mapping[str, ArrayLike] | None = None, photos: int | None = None, block: int | None = None,
                max_error: float | None = None) -> answers.Relighting:
        """Captures the light transport in a few dozen photos, and answers by the model; a run answers without any photo.

        Args:
            patterns: Patterns of the projector's pixels to relight with. Default: white.
            duals: Patterns of the camera's pixels, for dual photographs.
            photographs: Photos to take the interreflections out of.
            photos: Photos of the capture. Default 40.
            block: Patterns that are chosen beforehand; 1 is white alone. Default 12.
            max_error: The largest error of a relit photo that is good enough (scenes only).

        References: O'Toole and Kutulakos, *Optical computing for fast light transport analysis* (2010).
        """
        if patterns is None:
            patterns = {"white": np.ones(self.projector_shape, np.float32)}

        pictures = [
            (field, name, _checks.picture(array, f"{field}[{name!r}]", size, self.channels).astype(np.float64))
            for field, of, size in (("patterns", patterns, self.projector_shape), ("duals", duals, self.shape),
                                    ("photographs", photographs, self.shape))
            for name, array in dict(of or {}).items()
        ]
        return _declared.ask(self, "relight", {"photos": photos, "block": block, "max_error": max_error}, pictures)

    def plan(self, verb: Literal["segment", "compensate", "eigs"], *arguments: Any, trials: int = 3,
             **options: Any) -> answers.Plan:
        """Predicts photos, time and error of a verb on a rig, by runs on the rig's virtual twin.

        The twin is the virtual rig with all faults that its file gives it, in front of light transport that is known
        exactly. Each trial takes the whole measurement on it with noise of its own, and its answer is compared with that
        of ideal devices. Nothing is taken from a photo budget, and no folder is needed.

        Args:
            verb: ``"segment"``, ``"compensate"`` or ``"eigs"``.
            *arguments, **options: Those of :meth:`segment`, :meth:`compensate` or :meth:`eigs`, such as ``groups=[2],
                photos=40``. What those do beside their answer is not planned: evidence, features, blur, direct light
                that is measured, colours, models, and comparisons of methods.
            trials: Runs on the twin.

        Raises:
            krylux.errors.OptionError: The source is no rig, there is no such verb, or an argument cannot be planned.
            krylux.errors.DataError: The rig's devices are real, so that there is no twin.

        Examples:
            >>> lab = krylux.open("assets/rigs/realistic.toml")             # doctest: +SKIP
            >>> lab.plan("segment", [2], photos=40).seconds.mean()          # doctest: +SKIP
        """
        known: dict[str, Any] = {"segment": self.segment, "compensate": self.compensate, "eigs": self.eigs}
        if verb not in known:
            raise _checks.refuse("verb", f"there is no plan of {verb!r}", 'give "segment", "compensate" or "eigs"')
        trials = _checks.count(trials, "trials")
        bound = inspect.signature(known[verb]).bind(*arguments, **options)
        given, pictures = _declared.pictures_apart(self, bound.arguments, ("target",) if verb == "compensate" else ())
        if any(picture.ndim == 3 for _, _, picture in pictures):
            raise _checks.refuse("target", "it is coloured, and a plan is of gray light", "give an array of H×W")
        return answers.Plan(self._native.plan(verb, _declared.asked(given), pictures, trials))

    def through_rig(self, rig: _checks.FilePath, *, folder: _checks.FilePath | None = None, resume: bool = False,
                    overwrite: bool = False) -> Self:
        """Looks at the same scene through the virtual devices of a rig file.

        The file's own scene is left aside, and this one is not traced again. So the photos of a realistic projector and
        camera can be compared with the true light. The devices are taken as ideal where the file names no calibration,
        until :meth:`calibrate`.

        Args:
            rig: A rig file (``.toml``) of virtual devices.
            folder, resume, overwrite: As those of :func:`krylux.open`, for a run of the new laboratory.

        Returns: A laboratory of kind ``"rig"``, whose unit is DN/s. This one stays open.

        Raises:
            krylux.errors.DataError: There is no scene, or the devices are real.
            krylux.errors.OptionError: The scene's projector has other pixels than its camera.

        Examples:
            >>> exact = krylux.open("assets/scenes/corner/scene.glb", size=32)      # doctest: +SKIP
            >>> rig = exact.through_rig("assets/rigs/realistic.toml")               # doctest: +SKIP
            >>> rig.calibrate()                                                     # doctest: +SKIP
            >>> seen, light = rig.white, exact.white                                # doctest: +SKIP
        """
        path = os.path.abspath(rig)
        if not os.path.isfile(path):
            raise _checks.refuse("rig", f"there is no file {os.fspath(rig)!r}", "give a rig file (.toml)")
        lab = object.__new__(type(self))
        lab._source, lab._options, lab._is_calibrated = self._source, self._options, False
        lab._rigs = (*self._rigs, path)
        lab._hold(self._native.through_rig(path))
        if folder is not None:
            lab._native.begin_run(folder, bool(resume), bool(overwrite))
        elif resume or overwrite:
            raise _checks.refuse("folder", "there is none to go on with or to use anew", "name the folder")
        return lab

    def calibrate(self, *, takes: int = 2, map: Literal["gray-code", "checkerboard"] | None = None,
                  flat_field: bool = False) -> _Report:
        """Calibrates the devices of a rig from captures alone, and takes photos by that from now on.

        Nothing is written: :func:`krylux.rig.calibrate` leaves a folder that a rig file can name. Call it before the
        first photo of a run.

        Args:
            takes: Frames averaged for each level and pattern.
            map: ``"gray-code"`` or ``"checkerboard"``. Default: as the camera's pixels allow.
            flat_field: Measure also how uneven projector and camera are, by a matte sheet: a virtual rig gets one in
                place of its scene; before a real one it has to stand when the rest is done.

        Returns: ``report``, every figure with its standard error, and ``lines``, the same in words.

        Raises:
            krylux.errors.OptionError: The source is no rig.
            krylux.errors.RigError: The rig fails, or its photos cannot be evaluated.
        """
        from .rig import Report

        asked = _declared.asked({"takes": _checks.count(takes, "takes"), "map": map})
        found = self._native.calibrate(asked, bool(flat_field))
        self._is_calibrated = True
        return Report(found)

    @property
    def folder(self) -> Path | None:
        """The folder of the open run, or ``None``."""
        return self._native.folder()

    def close(self) -> None:
        """Ends the open run, and frees devices and memory. Operators that were handed out stay valid."""
        self._native.close()

    @property
    def is_closed(self) -> bool:
        """Whether the laboratory is closed."""
        return self._native.is_closed

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self):
        if self._is_calibrated:
            raise TypeError(
                "the laboratory was calibrated in this process, which a copy in another would not know\n"
                "  help: write the calibration by krylux.rig.calibrate, name it in the rig file, and open that"
            )
        # Another process cannot use the same folder at the same time, nor this one's callback.
        options = {**self._options, "folder": None, "resume": False, "overwrite": False, "progress": None}
        source = self._source
        if isinstance(source, (str, os.PathLike)):
            source = os.path.abspath(source)
        return (_again, (source, options, self._rigs))

    def __repr__(self) -> str:
        height, width = self.shape
        return f"<krylux.Lab {self.name}: {self.kind}, {width}×{height} pixels, {self.channels} channel(s)>"

    def _repr_html_(self) -> str:
        figures = []
        # A rig's photos are dear: none is taken to look at it.
        if self.kind in ("scene", "run") and not self.is_closed:
            figures.append(_display.Picture(_display.light(self.white), f"white photo, in {self.unit}"))
        return _display.page(f"Laboratory {self.name}", repr(self).strip("<>"), *figures)


def _again(source, options, rigs):
    """A laboratory with the same settings, through the same rigs."""
    lab = Lab(source, options)
    for rig in rigs:
        lab = lab.through_rig(rig)
    return lab


def open(
    source: Scene | ArrayLike | _checks.FilePath | _ProgramRig | Any, *, size: int | tuple[int, int] | None = None,
    projector_size: int | tuple[int, int] | None = None, spp: int | None = None, max_bounces: int | None = None,
    seed: int | None = None, sampler: Literal["sobol", "independent"] | None = None, russian_roulette: bool = False,
    channels: Literal["luma", "rgb", "native"] = "luma", camera: str | None = None,
    camera_file: _checks.FilePath | None = None, auto_camera: bool = False, strict: bool = False,
    allow_programs: bool = False, adapter: str | None = None, cache: _checks.FilePath | bool | None = None,
    operator: Literal["auto", "replay", "retrace"] = "auto", products: Literal["auto", "cpu", "device"] = "auto",
    memory: int | None = None, split_bounces: bool = False, folder: _checks.FilePath | None = None,
    resume: bool = False, overwrite: bool = False, progress: _progress.Progress = None, name: str | None = None,
) -> Lab:
    """Opens a scene, a rig, the folder of an earlier run, or a matrix.

    Args:
        source: A :class:`krylux.Scene`, a scene file (``.glb``, ``.gltf``, ``.obj``), a rig file (``.toml``), the folder
            of an earlier run, a matrix file (``.npz``, ``.npy``, ``.mtx``, ``.mtx.gz``, ``.mat``), a SciPy sparse matrix,
            a NumPy array (a matrix, or ``[H, W, h, w]``, with colours ``[H, W, 3, h, w]``, ``[3, H, W, h, w]`` or
            ``[H, W, h, w, 3]``), or devices of Python.
        size: Pixels of camera and projector: the side of a square, or ``(width, height)``. Default 128, or what a rig
            file says. For a matrix that came without it, the size of its photos, whose pixels are rows.
        projector_size: Pixels of a projector that stands apart from the camera, or of the patterns of a matrix.
        spp: Light paths per camera pixel. Default 64.
        max_bounces: Surfaces that a light path meets at most; 1 is direct light only. Default 6.
        seed: Selects the random numbers of the tracer and of starting vectors. Default 0.
        sampler: ``"sobol"`` (the default) or ``"independent"``.
        russian_roulette: End dim light paths by chance.
        channels: ``"luma"`` (one gray system, the default), ``"rgb"`` (three), or ``"native"`` (what the source sees).
        camera: The camera of the scene, by name.
        camera_file: Where camera and projector stand, instead of the scene's own poses.
        auto_camera: Place a camera in front of a scene that has none.
        strict: End where a picture or a material library of the scene is missing, in place of a warning.
        allow_programs: Run the programs that a rig file names, though the file is not in the user's own folder
            (``~/.config/krylux``).
        adapter: Part of the name of the graphics adapter.
        cache: Where matrices are kept for later runs; ``False``: nowhere. Default: ``KRYLUX_CACHE``, or the user's
            cache folder.
        operator: How photos of a scene are computed: ``"auto"``, ``"replay"`` (products with a matrix) or
            ``"retrace"``.
        products: Where products are computed: ``"auto"``, ``"cpu"`` or ``"device"``.
        memory: Bytes that a matrix may take while it is assembled. Default: half of the machine's.
        split_bounces: Keep the second bounce apart from later ones.
        folder: A folder for the run: its journal keeps every photo before it is used.
        resume: Go on with the run in ``folder``: no photo of its journal is taken again.
        overwrite: Use a ``folder`` that holds an earlier run.
        progress: ``True`` shows bars where tqdm is installed; a function is called with ``(stage, done, total,
            estimate)``; ``False`` is silent. Default: bars on a terminal and in a notebook.
        name: A name for a matrix or for devices of Python, for titles.

    Returns: The laboratory. It is a context manager, which closes it.

    Raises:
        krylux.Error: The source cannot be read, or has no use for an argument. The message names both.
    """
    options = dict(locals())
    return Lab(options.pop("source"), options)


def request(source, options):
    """What the native part opens: the arguments of :func:`open`, checked."""
    bound = inspect.signature(open).bind(source, **options)
    bound.apply_defaults()
    asked = bound.arguments
    for option, (check, *bounds) in _CHECKS.items():
        asked[option] = _checks.maybe(check, asked[option], option, *bounds)
    cache, progress = asked["cache"], _progress.choose(asked["progress"])
    asked |= {"cached": cache is not False, "cache": None if cache in (None, True, False) else cache}
    asked |= {"progress": progress, "matrix": None, "array": None, "rig": None, "devices": None, "scene": None}
    return asked | _source(source, asked.pop("name"))


#: Checks of numbers, and their bounds.
_CHECKS = {
    "size": (_checks.size,), "projector_size": (_checks.size,), "spp": (_checks.count,), "max_bounces": (_checks.count,),
    "seed": (_checks.count, 0, 2**32 - 1), "memory": (_checks.count, 0, 2**64 - 1),
}


def _source(source, name):
    from .rig import ProgramRig

    if isinstance(source, ProgramRig):
        return source._request(name)
    if isinstance(source, Scene):
        return {"source": source.name, "scene": source._native}
    if isinstance(source, (str, os.PathLike)):
        path = os.fspath(source)
        if not os.path.exists(path) and not path.endswith((".npz", ".mtx", ".npy", ".mat", ".gz")):
            raise _checks.refuse("source", f"there is no file or folder {path!r}",
                                 "give a scene (.glb, .gltf, .obj), a rig file (.toml), a run folder, or a matrix")
        return {"source": path}
    name = name or "matrix"
    if np.ndim(source) in (4, 5):
        # The camera's and the projector's axes, and perhaps one of colour: the array knows its pictures.
        return {"source": name, "array": _checks.real_array(source, "source", np.float64)}
    return {"source": name, "matrix": _matrix(source)}


def _matrix(source):
    """``(cols, data, indices, indptr)`` of a sparse or dense matrix."""
    import scipy.sparse

    if not scipy.sparse.issparse(source):
        dense = _checks.real_array(source, "source", np.float64)
        if dense.ndim != 2:
            help = "give a matrix, an array of [H, W, h, w] (with colours [H, W, 3, h, w], [3, H, W, h, w] or [H, W, h, w, 3]), a path or a rig"
            raise _checks.refuse("source", f"its shape is {dense.shape}", help)
        source = scipy.sparse.csr_array(dense)
    matrix = scipy.sparse.csr_array(source)
    _checks.real_array(matrix.data, "source", np.float64)
    if not matrix.has_canonical_format:
        matrix = matrix.copy()
        matrix.sum_duplicates()
    arrays = (matrix.data.astype(np.float64), matrix.indices.astype(np.int64), matrix.indptr.astype(np.int64))
    return (matrix.shape[1], *arrays)
