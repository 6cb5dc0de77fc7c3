"""Captures that NumPy made: patch radiosity of a corner, two sizes, 12 bits, gamma, a black level and noise."""

import struct
import zlib

import numpy as np
import pytest

import krylux

CAMERA, PROJECTOR = (20, 15), (16, 12)
GAMMA, BLACK, FULL, ELECTRONS = 2.2, 64, 4095, 5000


def corner(seed, patches=6):
    """Direct and global light (``m × n``) of three walls, seen by a camera beside the projector."""
    rng = np.random.default_rng(seed)
    axes = [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
    grid = (np.arange(patches) + 0.5) / patches
    centres, normals = np.zeros((3, patches, patches, 3)), np.zeros((3, patches, patches, 3))
    for wall, (normal, u, v) in enumerate(axes):
        centres[wall, ..., u], centres[wall, ..., v] = np.meshgrid(grid, grid, indexing="ij")
        normals[wall, ..., normal] = 1
    centres, normals = centres.reshape(-1, 3), normals.reshape(-1, 3)
    albedo = rng.uniform(0.4, 0.8, 3).repeat(patches**2)
    apart = centres[None] - centres[:, None]
    square = (apart**2).sum(-1) + 1e-9
    leaves = np.maximum(0, np.einsum("ijk,ik->ij", apart, normals))
    meets = np.maximum(0, -np.einsum("ijk,jk->ij", apart, normals))
    form = leaves * meets / square / (np.pi * square + 1 / patches**2) / patches**2
    bounces = np.linalg.inv(np.eye(len(form)) - albedo[:, None] * form)

    def rays(position, size, fine=4):
        """Points that each pixel sees, their wall, and their pixel."""
        width, height = size
        forward = 0.35 - np.array(position)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        x = ((np.arange(width * fine) + 0.5) / (width * fine) * 2 - 1) * 0.3
        y = -((np.arange(height * fine) + 0.5) / (height * fine) * 2 - 1) * 0.3 * height / width
        rays = forward + x[None, :, None] * right + y[:, None, None] * np.cross(right, forward)
        far = np.where(rays < -1e-9, -np.array(position) / rays, np.inf)
        points = position + far.min(-1)[..., None] * rays
        i, j = np.meshgrid(np.arange(height * fine) // fine, np.arange(width * fine) // fine, indexing="ij")
        return points.reshape(-1, 3), far.argmin(-1).ravel(), (i * width + j).ravel(), (position, forward, right)

    def patch(points, wall):
        u, v = np.array([1, 2, 0])[wall], np.array([2, 0, 1])[wall]
        at = np.clip(np.stack([points[np.arange(len(wall)), u], points[np.arange(len(wall)), v]]) * patches, 0, patches - 1)
        return wall * patches**2 + at.astype(int)[0] * patches + at.astype(int)[1]

    (m, n), fine = (CAMERA[0] * CAMERA[1], PROJECTOR[0] * PROJECTOR[1]), 16
    sent, seen, direct = np.zeros((len(form), n)), np.zeros((m, len(form))), np.zeros((m, n))
    points, wall, pixel, (source, forward, right) = rays((1.4, 1.4, 1.2), PROJECTOR)
    np.add.at(sent, (patch(points, wall), pixel), patches**2 / n / fine)
    points, wall, pixel, _ = rays((1.6, 1.2, 1.1), CAMERA)
    to = points - source
    x, y = to @ right / (to @ forward) / 0.3, -(to @ np.cross(right, forward)) / (to @ forward) / 0.3 * PROJECTOR[0] / PROJECTOR[1]
    lit = (abs(x) < 1) & (abs(y) < 1)
    home = ((y + 1) / 2 * PROJECTOR[1]).astype(int) * PROJECTOR[0] + ((x + 1) / 2 * PROJECTOR[0]).astype(int)
    cosine = -to[np.arange(len(to)), wall] / np.linalg.norm(to, axis=1)
    shade = albedo[patch(points, wall)] * cosine / (to**2).sum(1)
    np.add.at(direct, (pixel[lit], home[lit]), shade[lit] / fine)
    np.add.at(seen, (pixel, patch(points, wall)), 1 / fine)
    indirect = seen @ (bounces - np.eye(len(form))) @ (albedo[:, None] * sent)
    return direct, indirect * 0.5 * direct.sum() / indirect.sum()


def png(path, levels):
    """Writes levels as a gray PNG of 8 or 16 bits."""
    depth = 8 if levels.dtype == np.uint8 else 16
    rows = b"".join(b"\0" + row.astype(">u2" if depth == 16 else "u1").tobytes() for row in levels)
    header = struct.pack(">IIBBBBB", levels.shape[1], levels.shape[0], depth, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    body = b"".join(struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)


def patterns(count, rng):
    """Gray codes with their inverses, and random patterns of blocks and of pixels."""
    width, height = PROJECTOR
    code = lambda at, bit: ((at ^ (at >> 1)) >> bit) & 1
    lines = [np.tile(code(np.arange(width), bit), (height, 1)) for bit in range(4)]
    lines += [np.tile(code(np.arange(height), bit)[:, None], (1, width)) for bit in range(4)]
    shown = [np.abs(side - line).astype(float) for line in lines for side in (0, 1)]
    for k in range(count):
        block = 1 + k % 2 * 3
        shown.append(np.kron(rng.random((height // block, width // block)) < 0.5, np.ones((block, block))).astype(float))
    return shown


@pytest.fixture(scope="module", params=[0, 1])
def bench(request, tmp_path_factory):
    """A folder of captures as the guide describes it, and the matrix behind it, per second."""
    folder, rng = tmp_path_factory.mktemp("captures"), np.random.default_rng(request.param)
    matrix = sum(corner(request.param))
    matrix /= matrix.sum(1).max() / 0.8

    def photo(light):
        electrons = rng.poisson(np.maximum(light + 0.01, 0) * ELECTRONS) + rng.normal(0, 10, len(light))
        levels = np.clip(np.rint(electrons / ELECTRONS * (FULL - BLACK) + BLACK), 0, FULL)
        return levels.astype(np.uint16).reshape(CAMERA[::-1])

    for number, pattern in enumerate(patterns(40, rng)):
        levels = np.rint(255 * pattern ** (1 / GAMMA)).astype(np.uint8)
        png(folder / f"patterns/{number:03}.png", levels)
        for take in (1, 2):
            png(folder / f"take-{take}/{number:03}.png", photo(matrix @ (levels.ravel() / 255.0) ** GAMMA))
    png(folder / "black.png", photo(np.zeros(len(matrix))))
    (folder / "captures.toml").write_text(f"""
[patterns]
files = "patterns/*.png"
response = {GAMMA}
[photos]
files = ["take-1/*.png", "take-2/*.png"]
bits = 12
black_level = {BLACK}
exposure = 0.02
black = "black.png"
""")
    return folder, matrix / 0.02


def test_left_out_photos_are_predicted_and_errors_are_true(bench):
    folder, matrix = bench
    lab = krylux.open(folder, channels="native")
    answer = lab.imported()
    assert answer.noise_is_measured and answer.relative_error_left_out < 1.5 * answer.relative_noise
    squares = []
    rows, columns = np.mgrid[: PROJECTOR[1], : PROJECTOR[0]]
    for pattern in (rows // 3 + columns // 3) % 2, columns < 8, 0.5 + 0.5 * np.sin(columns / 4), np.ones_like(rows):
        found, error = lab.photo(pattern.astype(np.float32), with_error=True)
        truth = (matrix @ pattern.ravel()).reshape(CAMERA[::-1])
        # The photo of black is one frame, whose noise is in every prediction.
        squares.append(np.mean(((found - lab.ambient - truth) / np.hypot(error, 0.3)) ** 2))
    assert 0.5 < np.sqrt(np.mean(squares)) < 1.5, squares


def test_the_dual_image_and_a_compensation_are_right(bench, tmp_path):
    folder, matrix = bench
    lab = krylux.open(folder, channels="native")
    dual = lab.relight(duals={"white": np.ones(CAMERA[::-1])}).duals["white"]
    truth = matrix.sum(0).reshape(PROJECTOR[::-1])
    assert np.linalg.norm(dual - truth) < 0.05 * np.linalg.norm(truth)
    lab.imported().save(tmp_path / "run")
    again = krylux.open(tmp_path / "run", channels="native")
    np.testing.assert_array_equal(again.photo("left"), lab.photo("left"))


def test_arrays_are_imported(bench, tmp_path):
    _, matrix = bench
    rng = np.random.default_rng(5)
    shown = np.array(patterns(20, rng))
    taken = (matrix @ shown.reshape(len(shown), -1).T).T.reshape(len(shown), *CAMERA[::-1])
    takes = [taken * (1 + 0.01 * rng.standard_normal(taken.shape)) for _ in range(2)]
    lab = krylux.import_captures(shown, takes, folder=tmp_path / "captures", map="found")
    assert lab.projector_shape == PROJECTOR[::-1] and lab.imported().relative_error_left_out < 0.1
    with pytest.raises(krylux.errors.OptionError, match="holds captures"):
        krylux.import_captures(shown, taken, folder=tmp_path / "captures")
    with pytest.raises(krylux.errors.OptionError, match="photos"):
        krylux.import_captures(shown, taken[1:], folder=tmp_path / "others")
