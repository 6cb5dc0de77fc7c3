"""How alike two images are: what ``krylux compare`` says."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _display, _krylux


class Similarity:
    """How alike two images are: the answer of :func:`krylux.compare`.

    Attributes:
        rmse: The root mean square of the difference over all pixels and channels, in the unit of the images.
        relative_rmse: ``‖a − b‖ / ‖b‖``; infinite if only ``b`` is black.
        largest: The largest absolute difference.
        psnr: The peak signal-to-noise ratio in dB; infinite for equal images.
        ssim: The structural similarity, from -1 to 1; ``None`` for images of less than 11×11 pixels, SSIM's window.
        range: The data range of PSNR and SSIM.
        difference: ``float32[H, W]`` or ``[H, W, 3]``: ``a − b``.
    """

    rmse: float
    relative_rmse: float
    largest: float
    psnr: float
    ssim: float | None
    range: float
    difference: NDArray[np.float32]

    def __init__(self, fields: dict[str, Any]) -> None:
        self.__dict__.update(fields)

    def __repr__(self) -> str:
        ssim = "none" if self.ssim is None else f"{self.ssim:.4f}"
        return (f"<Similarity: rmse {self.rmse:.4g}, {100 * self.relative_rmse:.3g} % of b; "
                f"psnr {self.psnr:.2f} dB; ssim {ssim}>")

    def _repr_html_(self) -> str:
        plane = self.difference if self.difference.ndim == 2 else self.difference.mean(2)
        picture = _display.Picture(_display.signed(plane), "a − b: blue below, red above")
        return _display.page("Similarity", repr(self).strip("<>"), picture)


def compare(a: ArrayLike | _checks.FilePath, b: ArrayLike | _checks.FilePath, *, range: float | None = None) -> Similarity:
    """Compares two images: RMSE, PSNR and SSIM.

    Args:
        a, b: The image and the reference: ``[H, W]`` or ``[H, W, 3]`` of any real type, in single precision from here
            on; or files, ``.npy``, ``.exr``, ``.png``, ``.jpg``, ``.tif``, ``.hdr``, ``.pfm``, ``.pgm`` or ``.ppm``,
            which are read as linear values.
        range: The data range of PSNR and SSIM, such as 1 for pictures in [0, 1]. Default: from the least to the
            greatest value of ``b``.

    Raises:
        krylux.errors.OptionError: The images have different shapes, or one has NaN or is no image; or the range is not
            positive.
        krylux.errors.DataError: A file is malformed.

    References: Wang, Bovik, Sheikh and Simoncelli, *Image quality assessment: from error visibility to structural
        similarity* (2004), doi:10.1109/TIP.2003.819861.

    Examples:
        >>> krylux.compare(lab.photo(pattern), lab.white).relative_rmse     # doctest: +SKIP
    """
    a, b = _image(a, "a"), _image(b, "b")
    if a.shape != b.shape:
        raise _checks.refuse("a", f"its shape is {a.shape}, but that of b is {b.shape}",
                             "give two images of one size, both gray or both coloured")
    range = _checks.maybe(_checks.finite, range, "range")
    return Similarity({**_krylux.compare(a, b, range), "difference": a - b})


def _image(source: Any, option: str) -> NDArray[np.float32]:
    if isinstance(source, (str, os.PathLike)):
        return _krylux.read_picture(source)
    array = _checks.real_array(source, option, np.float32)
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] != 3) or array.size == 0:
        raise _checks.refuse(option, f"its shape is {array.shape}", "give an array of H×W or H×W×3, or a file")
    return array
