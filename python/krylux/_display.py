"""How answers look in a notebook: pictures without any plotting library."""

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
    """``uint8[H, W, 3]`` of radiance; the brightest hundredth of it is white, the curve is that of sRGB."""
    values = np.asarray(values, dtype=np.float64)
    values = values if values.ndim == 3 else values[..., None].repeat(3, 2)
    bright = np.quantile(values, 0.99) or 1.0
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


def image(pixels, caption):
    """An HTML figure."""
    data = base64.b64encode(png(pixels)).decode()
    return _figure(f'<img style="image-rendering:pixelated" src="data:image/png;base64,{data}"/>', caption)


def spectrum(values, residuals):
    """An HTML figure of eigenvalues as bars, whose tips are as wide as the residuals."""
    values, residuals = np.asarray(values, float), np.asarray(residuals, float)
    if not len(values):
        return ""
    top = max(float(np.max(np.abs(values))), 1e-300)
    bars = []
    for index, (value, residual) in enumerate(zip(values, residuals)):
        height = max(1.0, 90 * abs(value) / top)
        spread = min(90.0, 90 * residual / top)
        bars.append(
            f'<rect x="{8 + 16 * index}" y="{100 - height:.1f}" width="10" height="{height:.1f}" fill="#4477aa"/>'
            f'<line x1="{13 + 16 * index}" x2="{13 + 16 * index}" y1="{100 - height - spread:.1f}" '
            f'y2="{100 - height + spread:.1f}" stroke="#bb5566" stroke-width="2"/>'
        )
    drawn = f'<svg width="{16 * len(values) + 16}" height="104">{"".join(bars)}</svg>'
    return _figure(drawn, f"{len(values)} eigenvalues, the largest {top:.4g}")


def table(rows, head=()):
    """An HTML table of cells."""
    lines = ["".join(f"<th>{html.escape(cell)}</th>" for cell in head)] if head else []
    lines += ["".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) for row in rows]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def page(title, sentence, *figures):
    """HTML of an answer."""
    return f"<div><b>{html.escape(title)}</b><br/>{html.escape(sentence)}<br/>{''.join(figures)}</div>"
