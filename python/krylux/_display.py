"""How answers look: in a notebook, without any plotting library, as the text of a part; and drawn by Matplotlib."""

import base64
import html
import struct
import zlib

import numpy as np

#: Colours of groups, chosen so that neighbours differ in lightness as well.
_COLORS = np.array(
    [[68, 119, 170], [238, 102, 119], [34, 136, 51], [204, 187, 68], [102, 204, 238], [170, 51, 119],
     [187, 187, 187], [0, 68, 136], [221, 170, 51], [187, 85, 102]], dtype=np.uint8)


def png(pixels):
    """The bytes of a PNG of ``uint8[H, W, 3]``, whose pixels are repeated so that a small picture can be seen."""
    factor = max(1, 192 // max(pixels.shape[:2]))
    pixels = pixels.repeat(factor, 0).repeat(factor, 1)
    height, width, _ = pixels.shape

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    rows = b"".join(b"\0" + row.tobytes() for row in np.ascontiguousarray(pixels))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def light(values):
    """``uint8[H, W, 3]`` of radiance; the brightest hundredth of it is white, or its median half of white; the curve is that of sRGB."""
    values = np.asarray(values, dtype=np.float64)
    values = values if values.ndim == 3 else values[..., None].repeat(3, 2)
    bright = max(np.quantile(values, 0.99), 2 * np.median(values)) or 1.0
    scaled = np.clip(values / bright, 0, 1)
    curve = np.where(scaled <= 0.0031308, 12.92 * scaled, 1.055 * scaled ** (1 / 2.4) - 0.055)
    return (255 * curve + 0.5).astype(np.uint8)


def signed(values):
    """``uint8[H, W, 3]`` of signed values: blue below zero, white at zero, red above."""
    values = np.asarray(values, dtype=np.float64)
    scaled = np.clip(values / (np.quantile(np.abs(values), 0.995) or 1.0), -1, 1)
    weak = 1 - np.abs(scaled)
    red, blue = np.where(scaled >= 0, 1, weak), np.where(scaled <= 0, 1, weak)
    return (255 * np.stack([red, weak, blue], 2) + 0.5).astype(np.uint8)


def groups(labels):
    """``uint8[H, W, 3]`` of labels; pixels without one are black."""
    labels = np.asarray(labels)
    round_, color = np.divmod(labels.astype(int), len(_COLORS))
    # Colours come again, darker.
    colors = (_COLORS[color] * (0.6 ** np.minimum(round_, 4))[..., None]).astype(np.uint8)
    return np.where((labels == 255)[..., None], np.uint8(0), colors)


def _figure(content, caption):
    return (f'<figure style="display:inline-block;margin:4px;text-align:center">{content}'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>")


class Picture:
    """Pixels ``uint8[H, W, 3]`` with a caption."""

    def __init__(self, pixels, caption):
        self._pixels, self._caption = pixels, caption

    def __str__(self):
        data = base64.b64encode(png(self._pixels)).decode()
        return _figure(f'<img style="image-rendering:pixelated" src="data:image/png;base64,{data}"/>', self._caption)

    def draw(self, axes):
        axes.imshow(self._pixels, interpolation="nearest")
        axes.set(title=self._caption, xticks=(), yticks=())


class Spectrum:
    """Eigenvalues as bars, whose tips are as wide as the residuals."""

    def __init__(self, values, residuals):
        self._values, self._residuals = np.asarray(values, float), np.asarray(residuals, float)

    def __str__(self):
        if not len(self._values):
            return ""
        top = max(float(np.max(np.abs(self._values))), 1e-300)
        bars = []
        for index, (value, residual) in enumerate(zip(self._values, self._residuals)):
            height = max(1.0, 90 * abs(value) / top)
            spread = min(90.0, 90 * residual / top)
            bars.append(
                f'<rect x="{8 + 16 * index}" y="{100 - height:.1f}" width="10" height="{height:.1f}" fill="#4477aa"/>'
                f'<line x1="{13 + 16 * index}" x2="{13 + 16 * index}" y1="{100 - height - spread:.1f}" '
                f'y2="{100 - height + spread:.1f}" stroke="#bb5566" stroke-width="2"/>'
            )
        drawn = f'<svg width="{16 * len(bars) + 16}" height="104">{"".join(bars)}</svg>'
        return _figure(drawn, f"{len(bars)} eigenvalues, the largest {top:.4g}")

    def draw(self, axes):
        axes.bar(np.arange(1, len(self._values) + 1), self._values, yerr=self._residuals)
        axes.set(title="spectrum", xlabel="number", ylabel="value")


class Curve:
    """A residual after each product; a notebook says it in words."""

    def __init__(self, residuals):
        self._residuals = residuals

    def __str__(self):
        return ""

    def draw(self, axes):
        axes.semilogy(np.arange(1, len(self._residuals) + 1), self._residuals)
        axes.set(xlabel="products", ylabel="relative residual")


class Table:
    """Rows of cells, below the heads of their columns where there are such."""

    def __init__(self, rows, head=()):
        self._rows, self._head = [[str(cell) for cell in row] for row in rows], head

    def __str__(self):
        lines = ["".join(f"<th>{html.escape(cell)}</th>" for cell in self._head)] if self._head else []
        lines += ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in self._rows]
        return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"

    def draw(self, axes):
        axes.axis("off")
        axes.text(0, 1, "\n".join(": ".join(row) for row in self._rows), va="top", wrap=True)


def page(title, sentence, *parts):
    """HTML of an answer."""
    return f"<div><b>{html.escape(title)}</b><br/>{html.escape(sentence)}<br/>{''.join(map(str, parts))}</div>"


def plot(sentence, parts):
    """A figure of Matplotlib with the parts side by side."""
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("plot() draws with Matplotlib, which is not installed\n  help: pip install matplotlib") from error
    columns = max(1, min(4, len(parts)))
    rows = max(1, -(-len(parts) // columns))
    figure, axes = plt.subplots(rows, columns, figsize=(3.2 * columns, 3.2 * rows + 0.5), squeeze=False, layout="constrained")
    for place in axes.flat[len(parts):]:
        place.axis("off")
    for place, part in zip(axes.flat, parts):
        part.draw(place)
    figure.suptitle(sentence, wrap=True)
    return figure
