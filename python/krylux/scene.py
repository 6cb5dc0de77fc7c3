"""Scenes from arrays: meshes, materials, camera and projector, each number of which has a path.

Examples:
    >>> import numpy as np
    >>> corners = np.array([[-1, -1, -2], [1, -1, -2], [1, 1, -2], [-1, 1, -2]])
    >>> scene = Scene.from_arrays(corners, [[0, 1, 2], [0, 2, 3]], name="wall", albedo=0.5,
    ...                           camera={"position": [0, 0, 0], "look_at": [0, 0, -2], "vertical_fov": 40})
    >>> scene.params["wall.albedo"] = 0.8
    >>> float(scene.params["camera.vertical_fov"])
    40.0
    >>> krylux.open(scene, size=32).white                                       # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from . import _checks, _krylux, errors

#: The arrays that describe a mesh or a picture, and their data types; everything else is a number in single precision.
_WHOLE = {"faces": np.uint32, "texture": np.uint8}


class Scene:
    """A scene whose parameters can be read and set. Lengths are in metres.

    :func:`krylux.open` takes it in place of a file. A laboratory keeps the scene as it was when it was opened, so that
    many can be opened from one scene, with a change before each: what stays the same is used again. Scenes can be
    copied and pickled.

    Attributes:
        name: A short name, for folders and titles.
        params: All parameters, a mapping from paths to values: see :class:`Parameters`.
    """

    def __init__(self, name: str = "scene") -> None:
        self._native = _krylux.Scene(str(name))

    @classmethod
    def from_arrays(cls, vertices: ArrayLike, faces: ArrayLike, *, uv: ArrayLike | None = None,
                    normals: ArrayLike | None = None, name: str = "mesh", camera: Mapping[str, Any] | None = None,
                    projector: Mapping[str, Any] | None = None, **material: Any) -> Self:
        """Makes a scene of one mesh; :meth:`add_mesh` adds others.

        Args:
            vertices, faces, uv, normals, name, **material: As those of :meth:`add_mesh`.
            camera: A mapping with ``position``, ``look_at`` (or ``forward``), ``vertical_fov`` in degrees, and where
                they differ from the defaults ``up`` (+Y), ``aperture_radius`` (0: a pinhole) and ``focus_distance``.
                Without a camera, open the scene with ``auto_camera=True``.
            projector: The same for a projector that stands apart, and ``resolution`` ``(width, height)``. Default: at
                the camera.

        Raises:
            krylux.errors.OptionError: An array has another shape, NaN, or an index without a vertex; a value is out of
                range. The message names the parameter.
        """
        scene = cls(name)
        scene.add_mesh(name, vertices, faces, uv=uv, normals=normals, **material)
        for role, pose in (("camera", camera), ("projector", projector)):
            if pose is not None:
                scene._native.place(role, _checks.as_json(role, dict(pose)))
        return scene

    @classmethod
    def load(cls, path: _checks.FilePath, *, camera: str | None = None, camera_file: _checks.FilePath | None = None,
             auto_camera: bool = False, strict: bool = False) -> Self:
        """Loads a scene file (``.glb``, ``.gltf``, ``.obj``). The other arguments are those of :func:`krylux.open`.

        Meshes have the names of their nodes, and vertices are in world space. A second mesh or material of the same
        name gets a number: ``wall``, ``wall_2``.
        """
        options = {"camera": camera, "camera_file": camera_file, "auto_camera": bool(auto_camera),
                   "strict": bool(strict)}
        return cls._around(_krylux.Scene.load(path, options))

    @classmethod
    def _around(cls, native: _krylux.Scene) -> Self:
        scene = object.__new__(cls)
        scene._native = native
        return scene

    def add_mesh(self, name: str, vertices: ArrayLike, faces: ArrayLike, *, uv: ArrayLike | None = None,
                 normals: ArrayLike | None = None, material: str | None = None, **factors: Any) -> None:
        """Adds a mesh, which is a region of its own.

        Args:
            name: Its name, and that of its material.
            vertices: ``[n, 3]``.
            faces: ``[m, 3]`` indices of vertices, counter-clockwise as seen from the front.
            uv: Texture coordinates ``[n, 2]``; ``v`` points downwards, as in pictures.
            normals: Shading normals ``[n, 3]``, which are scaled to length 1. Default: those of the triangles.
            material: The name of a material in the scene. Default: a new one, two-sided and matte, of albedo 0.8.
            **factors: The new material's factors: ``albedo``, ``opacity``, ``metallic``, ``roughness``, ``specular``,
                ``specular_color``, ``ior``, ``emission``, ``transmission``, ``diffuse_transmission``,
                ``diffuse_transmission_color``, ``attenuation_color``, ``attenuation_distance`` (these two make it
                solid), ``normal_scale``, ``double_sided``; and pictures: ``albedo_texture`` (sRGB),
                ``metallic_roughness_texture``, ``normal_texture``, ``emissive_texture`` and so on, ``uint8[h, w, 3]``
                or ``[h, w, 4]``. They mean what they mean in glTF.

        Raises:
            krylux.errors.OptionError: As :meth:`from_arrays`; the scene stays as it was.
        """
        if material is not None and factors:
            raise _checks.refuse("material", f"the mesh has that of {material!r}, and {', '.join(factors)}",
                                 "set its parameters by scene.params, or leave material out")
        arrays = {"vertices": vertices, "faces": faces, "uv": uv, "normals": normals, **factors}
        given = [(f"{name}.{key}", value) for key, value in arrays.items() if value is not None]
        self._native.add_mesh(str(name), material, [(path, _value(path, value)) for path, value in given])

    @property
    def name(self) -> str:
        return self._native.name

    @property
    def params(self) -> Parameters:
        return Parameters(self)

    def save(self, path: _checks.FilePath) -> None:
        """Writes a ``.glb`` file. :meth:`load` reads the same parameters from it, and photos of it have the same bits."""
        self._native.save(path)

    def __copy__(self) -> Self:
        return self._around(self._native.copy())

    def __deepcopy__(self, _: Any) -> Self:
        return self.__copy__()

    def __reduce__(self):
        if not len(self.params):
            return (type(self), (self.name,))
        return (_unpickled, (type(self), self.name, self._native.glb()))

    def __repr__(self) -> str:
        return f"<krylux.Scene {self.name}: {len(self.params)} parameters>"


def _unpickled(cls, name, glb):
    return cls._around(_krylux.Scene.of_glb(name, glb))


class Parameters(MutableMapping[str, Any]):
    """The parameters of a scene by path, such as ``wall.albedo``, ``wall.vertices`` or ``camera.position``.

    A value is a number, a truth value (``double_sided``), ``float32[3]`` (colours and points), ``float32[n, 3]`` or
    ``[n, 2]`` (``vertices``, ``normals``, ``uv``), ``uint32[m, 3]`` (``faces``) or ``uint8[h, w, 4]`` (textures). It is a
    copy: set it again after a change. One number sets all channels of a colour. Textures, ``uv``, ``normals`` and the
    ``attenuation`` of a solid are listed where there are any, and can be set in any case. ``camera`` and ``projector``
    have ``position``, ``forward``, ``up``, ``vertical_fov`` (degrees), ``aperture_radius`` and ``focus_distance``.

    Raises:
        krylux.errors.ParameterError: There is no such parameter; the message names the nearest. It is a ``KeyError``.
        krylux.errors.OptionError: The value has another shape, another type or another range.
    """

    def __init__(self, scene: Scene) -> None:
        self._native = scene._native

    def __getitem__(self, path: str) -> Any:
        try:
            return self._native.get(path)
        except errors.OptionError as error:
            raise _no_parameter(error) from None

    def __setitem__(self, path: str, value: Any) -> None:
        try:
            self._native.set(path, _value(path, value))
        except errors.OptionError as error:
            raise _no_parameter(error) if "no such parameter" in str(error) else error from None

    def __delitem__(self, path: str) -> None:
        raise _checks.refuse(path, "a parameter of a scene cannot be removed", "set it to another value")

    def __iter__(self) -> Iterator[str]:
        return iter(self._native.parameters())

    def __len__(self) -> int:
        return len(self._native.parameters())

    def __repr__(self) -> str:
        return "\n".join(f"{path}: {_shown(value)}" for path, value in self.items())


def _no_parameter(error):
    return errors.ParameterError(error.args[0], option=error.option, help=error.help)


def _shown(value):
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"{value.dtype}{list(value.shape)}"
    return value.tolist() if isinstance(value, np.ndarray) else value


def _value(path: str, value: Any) -> Any:
    """A value for the native part: its data type follows from the property."""
    wanted = next((dtype for ending, dtype in _WHOLE.items() if path.endswith(ending)), np.float32)
    if wanted is np.float32:
        if isinstance(value, (bool, np.bool_)):
            return bool(value)
        array = np.asarray(value)
        if array.dtype.kind not in "fiu":
            raise _checks.refuse(path, f"its data type is {array.dtype}, but real numbers are expected",
                                 "give a number or an array of numbers", errors.ArrayError)
        # The range, and whether the numbers are finite, is checked by krylux, as far as the parameter demands it.
        if array.ndim == 0:
            return float(array)
        with np.errstate(over="ignore"):
            return np.array(array, dtype=np.float32, order="C")
    array = np.asarray(value)
    channels = (3,) if wanted is np.uint32 else (3, 4)
    shape = "(m, 3)" if wanted is np.uint32 else "(h, w, 3) or (h, w, 4)"
    if array.dtype.kind not in "iu" or (wanted is np.uint8 and array.dtype != np.uint8):
        kind = "indices" if wanted is np.uint32 else "uint8"
        raise _checks.refuse(path, f"its data type is {array.dtype}, but {kind} are expected",
                             f"give an array of shape {shape}", errors.ArrayError)
    if array.ndim != (2 if wanted is np.uint32 else 3) or array.shape[-1] not in channels:
        raise _checks.refuse(path, f"its shape is {array.shape}", f"give an array of shape {shape}")
    if wanted is np.uint32 and array.size and not 0 <= int(array.min()) <= int(array.max()) < 2**32:
        raise _checks.refuse(path, f"it has an index of {array.min() if array.min() < 0 else array.max()}",
                             "give indices of vertices, counted from 0")
    if wanted is np.uint8 and array.shape[-1] == 3:
        array = np.concatenate([array, np.full((*array.shape[:2], 1), 255, np.uint8)], axis=-1)
    return np.ascontiguousarray(array, dtype=wanted)
