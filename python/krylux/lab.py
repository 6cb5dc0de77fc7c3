"""The laboratory: one door to a scene, a rig, the folder of an earlier run, or a matrix."""

import os
import weakref

import numpy as np

from . import _checks, _display, _krylux, _opening
from ._rigs import OnRigs


class Lab(OnRigs):
    """An open laboratory. Obtain one by :func:`krylux.open`.

    Nothing is traced and no photo is taken before one is asked for. Threads may share a laboratory, and take turns. It
    can be pickled: the copy opens the same source with the same settings.

    Attributes
    ----------
    kind : str
        ``"scene"``, ``"rig"``, ``"run"`` or ``"matrix"``.
    name : str
        A short name, for folders and titles.
    shape, projector_shape : tuple of int
        ``(height, width)`` of photos and of patterns. A matrix of ``n`` rows has ``(1, n)``.
    channels : int
        1 (gray) or 3.
    unit : str
        The unit of photos: W/(m² sr) for scenes, DN/s for rigs.
    seed : int
        Seeds starting vectors and other choices by chance outside of the tracer.
    """

    def __init__(self, source, options):
        self._source = source
        self._options = options
        #: The rig files that the source is seen through, and whether its devices were calibrated since.
        self._rigs = ()
        self._is_calibrated = False
        self._hold(_krylux.Lab(_opening.request(source, options)))

    def _hold(self, native):
        self._native = native
        about = self._native.describe()
        self.kind = about["kind"]
        self.name = about["name"]
        self.shape = about["resolution"]
        self.projector_shape = about["projector"]
        self.channels = about["channels"]
        self.unit = about["unit"]
        self.seed = about["seed"]
        self._matrices = weakref.WeakValueDictionary()

    def photo(self, pattern, *, with_error=False):
        """Takes the photo of a pattern, with the ambient light.

        Parameters
        ----------
        pattern : array_like
            ``[H, W]`` or ``[H, W, 3]`` of the projector's pixels, any real type and any strides. 1 stands for an irradiance
            of 1 W/m² on a plane at 1 m, or for the projector's full light. A gray pattern lights all channels.
        with_error : bool
            Return also the standard error of each sample, or ``None`` where it is not known.

        Returns
        -------
        numpy.ndarray
            ``float32[H, W]`` or ``[H, W, 3]`` of the camera's pixels, in :attr:`unit`.

        Raises
        ------
        krylux.errors.OptionError
            The pattern has another shape, another type of data, or NaN.
        """
        if self.kind == "matrix":
            pattern = _checks.real_array(pattern, "pattern", np.float32)
            if pattern.size == self.projector_shape[0] * self.projector_shape[1]:
                pattern = pattern.reshape(self.projector_shape)
        pattern = _checks.picture(pattern, "pattern", self.projector_shape, self.channels)
        return self._native.photo_with_error(pattern) if with_error else self._native.photo(pattern)

    @property
    def white(self):
        """The photo under an all-ones pattern, ``float32[H, W]`` or ``[H, W, 3]``."""
        return self._native.plain(True)

    @property
    def ambient(self):
        """The photo without projector, ``float32[H, W]`` or ``[H, W, 3]``."""
        return self._native.plain(False)

    @property
    def noise(self):
        """The noise of the traced matrix, or ``None`` where none is known.

        A dictionary: ``white`` ``float32[H, W]``, the standard errors of the white photo; ``white_relative``, ``operator``
        and ``global_``, relative errors of the white photo, of the matrix, and of its global part.
        """
        return self._native.noise()

    @property
    def is_symmetric(self):
        """Whether the light transport matrix is symmetric: that of a coaxial rig."""
        return self._native.kind_of_light()[0]

    @property
    def is_simulated(self):
        """Whether photos cost only computing, as for every source but a rig."""
        return self._native.kind_of_light()[1]

    @property
    def costs(self):
        """The costs of a rig so far, as a dictionary; ``None`` for other sources."""
        return self._native.costs()["costs"]

    def product_noise(self, part="full"):
        """The expected error of a product with a vector of norm 1, or ``None`` where no matrix was traced."""
        return self._native.product_noise(part)

    def labels(self):
        """The region that the centre of each pixel of a scene sees, ``uint8[H, W]``; 255 sees none."""
        return self._native.labels()["labels"]

    def truth(self):
        """The true labels of the scene's author.

        Returns
        -------
        tuple of (numpy.ndarray, list of str) or None
            ``uint8[H, W]``, and the names of the regions.
        """
        truth = self._native.truth()
        return None if truth is None else (truth["labels"], truth["regions"])

    def matrix(self, part="full", *, channel=0):
        """The light transport matrix itself, without a copy.

        Parameters
        ----------
        part : str
            ``"full"``, ``"direct"`` or ``"global"`` light.
        channel : int
            The channel, from 0.

        Returns
        -------
        scipy.sparse.csr_array
            ``[pixels of a photo, pixels of a pattern]``, ``float64``. Its arrays are read-only views of krylux's own memory,
            which lives as long as one of them; matrices of one part and channel share it.

        Raises
        ------
        krylux.errors.OptionError
            The source takes photos, and has no matrix in memory.
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

    def operator(self, part="full", *, channel=0):
        """One part of the light transport as a linear operator; each product with it is one photo.

        Parameters
        ----------
        part : str
            ``"full"``, ``"direct"`` or ``"global"`` light.
        channel : int
            The channel, from 0.

        Returns
        -------
        krylux.LabOperator
            A :class:`scipy.sparse.linalg.LinearOperator`.
        """
        from .operator import LabOperator

        native = self._native.operator(part, _checks.count(channel, "channel", 0))
        return LabOperator(native, part, channel, self.shape, self.projector_shape)

    @property
    def folder(self):
        """The folder of the open run, or ``None``."""
        return self._native.folder()

    def close(self):
        """Ends the open run, and frees devices and memory. Operators that were handed out stay valid."""
        self._native.close()

    @property
    def is_closed(self):
        """Whether the laboratory is closed."""
        return self._native.is_closed

    def _save(self, answer, folder, overwrite):
        return self._native.save(answer, None if folder is None else os.fspath(folder), overwrite)

    def _findings(self, answer):
        return self._native.findings(answer)["findings"]

    def _check(self, answer):
        return self._native.check(answer)

    def __enter__(self):
        return self

    def __exit__(self, *_):
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

    def __repr__(self):
        height, width = self.shape
        return f"<krylux.Lab {self.name}: {self.kind}, {width}×{height} pixels, {self.channels} channel(s)>"

    def _repr_html_(self):
        figures = []
        # A rig's photos are dear: none is taken to look at it.
        if self.kind in ("scene", "run") and not self.is_closed:
            figures.append(_display.image(_display.light(self.white), f"white photo, in {self.unit}"))
        return _display.page(f"Laboratory {self.name}", repr(self).strip("<>"), *figures)


def _again(source, options, rigs):
    """A laboratory with the same settings, through the same rigs."""
    lab = Lab(source, options)
    for rig in rigs:
        lab = lab.through_rig(rig)
    return lab


def open(source, *, size=None, projector_size=None, spp=None, max_bounces=None, seed=None, sampler=None,
         russian_roulette=False, channels="luma", camera=None, camera_file=None, auto_camera=False, strict=False,
         allow_programs=False, adapter=None, cache=None, operator="auto", products="auto", memory=None,
         split_bounces=False, folder=None, resume=False, overwrite=False, progress=None, name=None):
    """Opens a scene, a rig, the folder of an earlier run, or a matrix.

    Parameters
    ----------
    source : path, matrix or krylux.rig.ProgramRig
        A scene (``.glb``, ``.gltf``, ``.obj``), a rig file (``.toml``), the folder of an earlier run, a matrix file
        (``.npz``, ``.mtx``, ``.npy``), a SciPy sparse matrix, a NumPy array of two dimensions, or devices of Python.
    size : int or (int, int)
        Pixels of camera and projector: the side of a square, or ``(width, height)``. Default 128, or what a rig file says.
    projector_size : int or (int, int)
        Pixels of a projector that stands apart from the camera.
    spp : int
        Light paths per camera pixel. Default 64.
    max_bounces : int
        Surfaces that a light path meets at most; 1 is direct light only. Default 6.
    seed : int
        Selects the random numbers of the tracer and of starting vectors. Default 0.
    sampler : str
        ``"sobol"`` (the default) or ``"independent"``.
    russian_roulette : bool
        End dim light paths by chance.
    channels : str
        ``"luma"`` (one gray system, the default), ``"rgb"`` (three), or ``"native"`` (what the source sees).
    camera : str
        The camera of the scene, by name.
    camera_file : path
        Where camera and projector stand, instead of the scene's own poses.
    auto_camera : bool
        Place a camera in front of a scene that has none.
    strict : bool
        End where a picture or a material library of the scene is missing, in place of a warning.
    allow_programs : bool
        Run the programs that a rig file names, though the file is not in the user's own folder (``~/.config/krylux``).
    adapter : str
        Part of the name of the graphics adapter.
    cache : path or bool
        Where matrices are kept for later runs; ``False``: nowhere. Default: ``KRYLUX_CACHE``, or the user's cache folder.
    operator : str
        How photos of a scene are computed: ``"auto"``, ``"replay"`` (products with a matrix) or ``"retrace"``.
    products : str
        Where products are computed: ``"auto"``, ``"cpu"`` or ``"device"``.
    memory : int
        Bytes that a matrix may take while it is assembled. Default: half of the machine's.
    split_bounces : bool
        Keep the second bounce apart from later ones.
    folder : path
        A folder for the run: its journal keeps every photo before it is used.
    resume : bool
        Go on with the run in ``folder``: no photo of its journal is taken again.
    overwrite : bool
        Use a ``folder`` that holds an earlier run.
    progress : bool or callable
        ``True`` shows bars where tqdm is installed; a function is called with ``(stage, done, total, estimate)``;
        ``False`` is silent. Default: bars on a terminal and in a notebook.
    name : str
        A name for a matrix or for devices of Python, for titles.

    Returns
    -------
    krylux.Lab
        The laboratory. It is a context manager, which closes it.

    Raises
    ------
    krylux.Error
        The source cannot be read, or has no use for an argument. The message names both.
    """
    options = dict(locals())
    return Lab(options.pop("source"), options)
