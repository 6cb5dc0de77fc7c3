"""A laboratory: photos, the matrix, labels, the folder of a run."""

import gc
import json
import pickle
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

import krylux

from conftest import ROOT, SCENES, in_another_process


def test_photos_are_the_same_for_any_type_and_strides(zigzag):
    pattern = np.random.default_rng(0).random((24, 24)).astype(np.float32)
    photo = zigzag.photo(pattern)
    assert photo.shape == (24, 24) and photo.dtype == np.float32
    wide = np.zeros((48, 72))
    wide[::2, ::3] = pattern
    for other in (pattern.astype(np.float64), np.asfortranarray(pattern), wide[::2, ::3], pattern[::-1][::-1],
                  pattern.tolist()):
        assert np.array_equal(zigzag.photo(other), photo)
    assert np.array_equal(zigzag.photo(np.ones((24, 24), bool)), zigzag.white)


def test_patterns_have_the_names_of_the_command_line(zigzag):
    lit = np.add.outer(np.arange(24) // 8, np.arange(24) // 8) % 2 == 0
    assert np.array_equal(zigzag.photo("checker:8"), zigzag.photo(lit))
    assert np.array_equal(zigzag.photo("white"), zigzag.white)
    for wrong in ("checkers", "checker", "pixel:99,0"):
        with pytest.raises(krylux.errors.OptionError, match="pattern"):
            zigzag.photo(wrong)


def test_photos_are_products_with_the_matrix(zigzag):
    pattern = np.random.default_rng(0).random((24, 24)).astype(np.float32)
    product = (zigzag.matrix() @ pattern.ravel().astype(float)).reshape(24, 24) + zigzag.ambient
    # Photos are rounded to single precision.
    assert np.allclose(zigzag.photo(pattern), product, rtol=1e-6)


def test_photos_are_those_of_the_command_line_byte_for_byte(command_line, tmp_path):
    scene, pattern = SCENES / "zigzag" / "scene.glb", np.random.default_rng(1).random((20, 24)).astype(np.float32)
    np.save(tmp_path / "pattern.npy", pattern)
    for operator in ("replay", "retrace"):
        command_line("photo", scene, "--size", "24x20", "--spp", 16, "--seed", 5, "--channels", "rgb", "--operator",
                     operator, "--pattern", tmp_path / "pattern.npy", "-o", tmp_path / "photo.npy")
        with krylux.open(scene, size=(24, 20), spp=16, seed=5, channels="rgb", operator=operator) as lab:
            assert lab.photo(pattern).tobytes() == np.load(tmp_path / "photo.npy").tobytes()


def test_coloured_photos_have_three_channels():
    with krylux.open(SCENES / "cornell" / "scene.glb", size=8, spp=8, channels="rgb", progress=False) as lab:
        gray, coloured = np.ones((8, 8)), np.ones((8, 8, 3))
        assert lab.channels == 3 and np.array_equal(lab.photo(gray), lab.photo(coloured))
        assert lab.photo(coloured).shape == (8, 8, 3)
        red, green = lab.matrix(channel=0), lab.matrix(channel=1)
        assert (red != green).nnz > 0
        with pytest.raises(krylux.errors.OptionError, match="channel: there is no channel 3"):
            lab.matrix(channel=3)


def test_the_parts_of_the_matrix_add_up(zigzag):
    full, direct, of_two = (zigzag.matrix(part) for part in ("full", "direct", "global"))
    assert isinstance(full, scipy.sparse.csr_array) and full.shape == (576, 576)
    assert direct.nnz <= 576 and abs(full - direct - of_two).max() < 1e-6 * full.max()


def address(matrix):
    """Where the entries of a matrix are in memory."""
    return matrix.data.__array_interface__["data"][0]


def test_the_matrix_is_a_view_that_keeps_its_memory_alive(zigzag):
    lab = krylux.open(scipy.sparse.eye_array(5, format="csr"))
    matrix, again = lab.matrix(), lab.matrix()
    assert address(matrix) == address(again), "the laboratory and both matrices share one array"
    of_scene = zigzag.matrix("global"), zigzag.matrix("global")
    assert address(of_scene[0]) == address(of_scene[1])
    for array in (matrix.data, matrix.indices):
        assert not array.flags.writeable and not array.flags.owndata
        with pytest.raises(ValueError):
            array.flags.writeable = True
    owner = weakref.ref(matrix.data.base)
    data = matrix.data
    del lab, matrix, again
    gc.collect()
    assert data.tolist() == [1.0] * 5 and owner() is not None
    del data
    gc.collect()
    assert owner() is None


def test_the_matrix_is_not_copied_in_memory():
    out = in_another_process("""
import numpy as np, scipy.sparse, krylux

def resident():
    for line in open('/proc/self/status'):
        if line.startswith('VmRSS'):
            return int(line.split()[1]) * 1024

n = 2_000_000
lab = krylux.open(scipy.sparse.diags_array([np.ones(n), np.ones(n - 1), np.ones(n - 2)], offsets=[0, 1, 2]).tocsr())
lab.matrix().sum()
before = resident()
matrices = [lab.matrix() for _ in range(4)]
total = sum(float(matrix.data[::1000].sum()) for matrix in matrices)
assert total > 0
print((resident() - before) / 4 / (matrices[0].data.nbytes + matrices[0].indices.nbytes))
""")
    # Only the offsets of the rows, 4 bytes of each, are made anew: 8 of 72 MB here. A copy of the entries would cost 1.
    assert float(out) < 0.25


def test_a_run_keeps_its_photos_and_answers_again(zigzag, tmp_path):
    with krylux.open(SCENES / "zigzag" / "scene.glb", size=16, spp=16, folder=tmp_path / "run", progress=False) as lab:
        first = lab.segment([2], photos=12)
        assert lab.folder == tmp_path / "run"
        first.save()
    assert (tmp_path / "run" / "report.html").exists()
    with krylux.open(tmp_path / "run") as replay:
        assert replay.kind == "run"
        again = replay.segment([2])
        assert np.array_equal(first.labels[2], again.labels[2]) and first.rand_index == again.rand_index


@pytest.mark.parametrize("ends", ["close", "forget"])
def test_a_run_without_an_answer_says_how_it_ended(tmp_path, ideal_rig, ends):
    for name, use, status in (("used", lambda lab: lab.photo(np.ones((8, 8))), "done"),
                              ("unused", lambda lab: None, "interrupted")):
        lab = krylux.open(ideal_rig, size=8, spp=4, folder=tmp_path / name, progress=False)
        use(lab)
        if ends == "close":
            lab.close()
        else:
            del lab
            gc.collect()
        record = json.loads((tmp_path / name / "run.json").read_text())
        assert record["status"] == status, record


def test_labels_and_truth(zigzag):
    labels, (truth, regions) = zigzag.labels(), zigzag.truth()
    assert labels.shape == (24, 24) and labels.dtype == np.uint8
    assert len(regions) == 2 and set(np.unique(truth)) <= {0, 1, 255}
    assert krylux.open(np.eye(3)).truth() is None


def test_laboratories_answers_and_matrices_are_pickled(zigzag):
    copy = pickle.loads(pickle.dumps(zigzag))
    assert np.array_equal(copy.white, zigzag.white)
    answer = pickle.loads(pickle.dumps(zigzag.eigs(2, part="global", photos=8)))
    assert answer.values.shape == (2,)
    matrix = pickle.loads(pickle.dumps(zigzag.matrix()))
    assert (matrix != zigzag.matrix()).nnz == 0
    explicit = pickle.loads(pickle.dumps(krylux.open(scipy.sparse.eye_array(3), seed=4)))
    assert explicit.seed == 4 and np.array_equal(explicit.matrix().toarray(), np.eye(3))
    with pytest.raises(TypeError, match="pickle the laboratory"):
        pickle.dumps(zigzag.operator())
    with pytest.raises(krylux.errors.ClosedError):
        answer.save("anywhere")


def test_matrices_of_any_form_are_sources(tmp_path, rectangular):
    scipy.sparse.save_npz(tmp_path / "matrix.npz", rectangular)
    dense = rectangular.toarray()
    doubled = scipy.sparse.coo_array((np.ones(4), ([0, 0, 1, 1], [2, 2, 1, 0])), shape=(2, 3))
    for source, true in ((tmp_path / "matrix.npz", dense), (rectangular, dense), (rectangular.tocsc(), dense),
                         (dense, dense), (dense.astype(np.float32), dense.astype(np.float32)),
                         (doubled, doubled.toarray())):
        assert np.array_equal(krylux.open(source).matrix().toarray(), true)


def test_the_size_of_a_matrix_says_which_pictures_it_maps():
    rng = np.random.default_rng(4)
    # Small whole numbers: sums are exact in single precision.
    dense = rng.integers(0, 5, (48, 48)).astype(float)
    matrix = scipy.sparse.csr_array(dense)
    with krylux.open(matrix, size=(8, 6)) as lab:
        assert lab.shape == lab.projector_shape == (6, 8)
        left = np.zeros((6, 8))
        left[:, :4] = 1
        assert np.array_equal(lab.photo("left"), (dense @ left.ravel()).reshape(6, 8))
        assert np.array_equal(lab.photo(left), lab.photo("left"))
        assert np.array_equal(lab.photo("pixel:3,2"), dense[:, 2 * 8 + 3].reshape(6, 8))
        assert lab.white.shape == (6, 8)


def test_a_matrix_may_map_pictures_of_two_sizes():
    dense = np.random.default_rng(5).integers(0, 5, (48, 20)).astype(float)
    with krylux.open(scipy.sparse.csr_array(dense), size=(8, 6), projector_size=(5, 4)) as lab:
        assert (lab.shape, lab.projector_shape) == ((6, 8), (4, 5))
        pattern = np.random.default_rng(6).integers(0, 2, (4, 5)).astype(float)
        assert np.array_equal(lab.photo(pattern), (dense @ pattern.ravel()).reshape(6, 8))
        lit = np.zeros((4, 5))
        lit[:, :2] = 1
        assert np.array_equal(lab.photo("left"), lab.photo(lit))
        assert np.array_equal(lab.matrix().toarray(), dense)
        with pytest.raises(krylux.errors.OptionError, match=r"^pattern: its shape is \(6, 8\), but 4 × 5"):
            lab.photo(np.ones((6, 8)))


def test_the_axes_of_an_array_say_which_pictures_it_maps(tmp_path):
    gray = np.random.default_rng(8).integers(0, 5, (6, 8, 4, 5)).astype(np.float32)
    with krylux.open(gray) as lab:
        assert (lab.shape, lab.projector_shape, lab.channels) == ((6, 8), (4, 5), 1)
        assert np.array_equal(lab.matrix().toarray(), gray.reshape(48, 20))
    rgb = np.stack([gray, 2 * gray, gray + 1])
    for axis in (0, 2, 4):
        # The axis of colour is moved without a copy, so that the array is not contiguous.
        array = np.moveaxis(rgb, 0, axis)
        np.save(tmp_path / "array.npy", array)
        for source in (array, tmp_path / "array.npy"):
            with krylux.open(source, channels="rgb") as lab:
                assert (lab.shape, lab.projector_shape, lab.channels) == ((6, 8), (4, 5), 3)
                for channel in range(3):
                    assert np.array_equal(lab.matrix(channel=channel).toarray(), rgb[channel].reshape(48, 20))
    with krylux.open(np.moveaxis(rgb, 0, 2)) as lab:
        assert lab.channels == 1
        weights = np.array([0.2126, 0.7152, 0.0722])
        assert np.allclose(lab.matrix().toarray(), np.tensordot(weights, rgb, 1).reshape(48, 20), rtol=1e-3)


@pytest.mark.parametrize(("shape", "message"), [
    ((3, 3, 2, 2, 3), "which of its axes is colour is not certain"),
    ((4, 4, 2, 2, 2), "which of its axes is colour is not certain"),
    ((4, 4, 2), r"its shape is \(4, 4, 2\)"),
])
def test_arrays_whose_axes_have_no_meaning_are_refused(shape, message):
    with pytest.raises(krylux.Error, match=message):
        krylux.open(np.ones(shape))
    with pytest.raises(krylux.errors.OptionError, match="states 2x4"):
        krylux.open(np.ones((4, 2, 2, 2)), size=(4, 2))


def test_a_matrix_without_a_size_has_no_left_half():
    with krylux.open(scipy.sparse.eye_array(48, format="csr")) as lab:
        assert lab.shape == (1, 48)
        assert np.array_equal(lab.photo("white"), np.ones((1, 48)))
        with pytest.raises(krylux.errors.OptionError, match="48 rows and 48 columns") as caught:
            lab.photo("left")
        assert caught.value.option == "size" and "projector_size" in caught.value.help
        assert "--" not in str(caught.value)


@pytest.mark.parametrize("sizes, option", [
    ({"size": (7, 6)}, "size"), ({"size": 8}, "size"), ({"size": (8, 6)}, "projector_size"),
    ({"projector_size": (5, 4)}, "size"), ({"size": (8, 6), "projector_size": (6, 4)}, "projector_size"),
])
def test_sizes_that_do_not_fit_a_matrix_are_named(sizes, option):
    with pytest.raises(krylux.errors.OptionError) as caught:
        krylux.open(scipy.sparse.csr_array(np.ones((48, 20))), **sizes)
    assert caught.value.option == option and "--" not in str(caught.value)


def test_matrices_in_files_of_other_formats_are_sources(tmp_path):
    import scipy.io

    matrix = scipy.sparse.random_array((48, 20), density=0.3, rng=np.random.default_rng(7), format="csc")
    dense = matrix.toarray()
    scipy.io.savemat(tmp_path / "sparse.mat", {"T": matrix, "scale": 2.0}, do_compression=True)
    scipy.io.savemat(tmp_path / "dense.mat", {"T": dense})
    scipy.io.mmwrite(tmp_path / "general.mtx", matrix, precision=17)
    np.savez(tmp_path / "dense.npz", T=dense)
    np.save(tmp_path / "axes.npy", dense.reshape(6, 8, 4, 5))
    for name in ("csr", "csc", "coo", "bsr", "dia"):
        scipy.sparse.save_npz(tmp_path / f"{name}.npz", matrix.asformat(name))
    names = {path.name for path in tmp_path.iterdir()}
    assert len(names) == 10
    for name in names:
        with krylux.open(tmp_path / name) as lab:
            assert np.array_equal(lab.matrix().toarray(), dense), name
            assert lab.shape == ((6, 8) if name == "axes.npy" else (1, 48)), name


def test_nothing_is_loaded_before_it_is_needed():
    in_another_process("""
import sys
import krylux
assert 'scipy' not in sys.modules
maps = open('/proc/self/maps').read()
assert 'vulkan' not in maps and 'lvp' not in maps
""")


def test_matrices_and_runs_need_no_vulkan(zigzag, tmp_path):
    with krylux.open(SCENES / "zigzag" / "scene.glb", size=12, spp=8, folder=tmp_path / "run", progress=False) as lab:
        lab.segment([2], photos=10).save()
    # As on a machine without a driver: the loader finds none.
    nowhere = {name: str(tmp_path / "nowhere.json") for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES")}
    in_another_process("""
import sys, numpy as np, krylux
assert np.allclose(krylux.open(np.diag([3.0, 2.0, 1.0])).eigs(1, photos=3).values, [3.0])
krylux.open(sys.argv[1]).segment([2])
assert 'vulkan' not in open('/proc/self/maps').read()
try:
    krylux.open('assets/scenes/zigzag/scene.glb', size=8, cache=False).white
except krylux.errors.NoAdapterError as error:
    assert 'Vulkan' in str(error) and error.help
else:
    raise AssertionError('a scene was traced without Vulkan')
""", tmp_path / "run", **nowhere)


def test_singular_values_come_with_patterns_and_their_photos(zigzag, tmp_path):
    dense = zigzag.matrix("global").toarray()
    found = zigzag.singular(3, part="global", photos=60, tolerance=1e-6)
    assert np.allclose(found.values, np.linalg.svd(dense, compute_uv=False)[:3], rtol=1e-5)
    assert found.patterns.shape == found.photographs.shape == (3, 24, 24)
    for value, pattern, photo in zip(found.values, found.patterns, found.photographs, strict=True):
        assert np.allclose(dense @ pattern.ravel(), value * photo.ravel(), atol=1e-5 * found.values[0])
    assert found._repr_html_().count("<img") == 6 and found.photos <= 60
    saved = found.save(tmp_path / "singular")
    assert (saved / "report.html").exists()
    with pytest.raises(krylux.errors.OptionError, match="^photos: a step"):
        zigzag.singular(photos=1)


@pytest.mark.parametrize("page", ["README.md", "python/README.md"])
def test_the_example_of_the_readme_runs_as_it_is_printed(page, tmp_path):
    text = (ROOT / page).read_text()
    code = text.split("```python\n")[1].split("```")[0]
    assert len([line for line in code.splitlines() if line and not line.startswith("import")]) <= 5
    (tmp_path / "assets").symlink_to(ROOT / "assets")
    in_another_process(code, folder=tmp_path, timeout=300)


def test_a_notebook_shows_labels_photos_and_spectra(zigzag):
    found = zigzag.segment([2], photos=12)
    assert found._repr_png_().startswith(b"\x89PNG") and "independent regions" in found._repr_html_()
    assert zigzag._repr_html_().count("data:image/png") == 1
    pairs = zigzag.eigs(2, part="global", photos=8)
    assert pairs._repr_html_().count("<img") == 2 and "<svg" in pairs._repr_html_()


def test_answers_are_plotted_part_by_part(zigzag, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    found = zigzag.segment([2], photos=12)
    figure = found.plot()
    titles = [axes.get_title() for axes in figure.axes if axes.axison]
    # Labels, the spectrum, and four eigenvectors.
    assert titles[:2] == ["2 groups", "spectrum"] and len(titles) == 6
    assert figure.get_suptitle() == found.status
    assert len(zigzag.audit(2).plot().axes) == 1
    residuals = krylux.krylov.solve("cg", np.diag([1.0, 2.0]), np.ones(2)).plot().axes[0]
    assert residuals.get_ylabel() == "relative residual"
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        found.plot()


def test_the_stub_describes_the_verbs_as_krylux_declares_them():
    from krylux import _declared

    stub = Path(krylux.__file__).with_name("_asking.pyi").read_text()
    assert _declared.stub() in stub
    assert "groups" in krylux.Lab.segment.__doc__ and "Numbers of groups" in krylux.Lab.segment.__doc__
