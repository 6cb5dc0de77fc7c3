"""The verbs: arrays as attributes, and what ``save`` leaves."""

import json

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import krylux

from conftest import SCENES


def saved(answer, folder):
    """The files that an answer leaves, and its record."""
    path = answer.save(folder)
    assert path == folder and (folder / "report.html").exists()
    return {file.name for file in folder.iterdir()}, json.loads((folder / "run.json").read_text())


def test_segment_finds_the_true_regions(zigzag, tmp_path):
    found = zigzag.segment([2, 3], photos=30, evidence=True, features=[(3, 4), (20, 10)])
    assert set(found.labels) == {2, 3} and found.labels[2].shape == (24, 24)
    assert all(np.ma.isMaskedArray(labels) and (labels.mask == found.mask).all() for labels in found.labels.values())
    assert found.rand_index[2] == 1.0, "the two halves of this scene exchange no light"
    assert found.eigenvectors.shape == (len(found.eigenvalues), 24, 24) and found.eigenvalues[0] == 1
    assert found.evidence[2]["exchange"].shape == (2, 2)
    # Each half keeps its light, up to the few paths through the pixels on their border.
    assert np.diag(found.evidence[2]["exchange"]).min() > 0.99
    assert found.features["distances"].shape == (2, 2) and found.features["distances"][0, 0] == 0
    assert found.mask.dtype == bool and found.regions["count"] >= 1
    files, record = saved(found, tmp_path / "segment")
    assert {"eigenvalues.npy", "report.html"} <= files and record["photos"] == found.photos
    assert np.array_equal(np.load(tmp_path / "segment" / "eigenvalues.npy"), found.eigenvalues)


def test_eigs_equals_the_dense_spectrum(zigzag, dense, tmp_path):
    found = zigzag.eigs(3, part="global", photos=120, tolerance=1e-10)
    assert np.allclose(found.values, scipy.linalg.eigvalsh(dense)[::-1][:3], rtol=1e-9)
    products = dense @ found.vectors
    assert np.linalg.norm(products - found.vectors * found.values) < 1e-8
    assert found.picture(0).shape == (24, 24) and found.history[-1][0] == found.photos
    files, record = saved(found, tmp_path / "eigs")
    assert "eigenvectors.npy" in files and record["status"] == "done"


def test_compensate_shows_the_target(zigzag, tmp_path):
    target = np.full((24, 24), 0.5)
    found = zigzag.compensate(target, photos=15)
    assert found.pattern.min() >= 0 and found.pattern.max() <= 1
    photo = zigzag.photo(found.pattern)
    assert np.allclose(photo, found.observed, rtol=1e-5), "the photo of the pattern is what was observed"
    assert found.residual < 0.5 * found.uncompensated_residual
    assert len(found.history) == found.photos and (np.diff(found.history) <= 1e-12).all()
    files, _ = saved(found, tmp_path / "compensate")
    assert np.array_equal(np.load(tmp_path / "compensate" / "compensation.npy"), found.pattern)
    compared = zigzag.compensate(target, photos=4, compare_methods=True, floor=0.1)
    assert compared.pattern.min() >= np.float32(0.1) and "minres" in compared.methods


def test_compensate_between_pictures_of_two_sizes():
    rng = np.random.default_rng(8)
    # Each pixel of the 8×6 photo sees one pixel of the 5×4 pattern, and a little of all others.
    rows, columns = np.divmod(np.arange(48), 8)
    dense = 0.02 * rng.random((48, 20))
    dense[np.arange(48), rows * 4 // 6 * 5 + columns * 5 // 8] += 1
    light = (dense @ rng.random(20)).reshape(6, 8)
    with krylux.open(dense, size=(8, 6), projector_size=(5, 4)) as lab:
        found = lab.compensate(light / light.max(), method="fista", photos=100, peak=float(light.max()))
        assert found.pattern.shape == (4, 5) and found.observed.shape == (6, 8)
        assert found.pattern.min() >= 0 and found.pattern.max() <= 1
        # A pattern inside the box gives this light, so the default tolerance is reached.
        assert found.residual <= 1e-3
        assert np.allclose(lab.photo(found.pattern), found.observed, rtol=1e-5)
        # Without the transpose, the brightest entries say which pixels belong together.
        mapped = lab.compensate(light / light.max(), method="krylov-box", peak=float(light.max()))
        assert mapped.residual < mapped.uncompensated_residual
        with pytest.raises(krylux.errors.OptionError) as caught:
            lab.compensate(light / light.max(), method="minres", peak=float(light.max()))
        assert caught.value.option == "method"


def test_separate_adds_up_to_the_white_photo(zigzag, tmp_path):
    exact = zigzag.separate(probes=0)
    assert np.allclose(exact.direct + exact.global_, zigzag.white, rtol=1e-5)
    measured = zigzag.separate("random", photos=200, probes=0)
    assert measured.error is not None and measured.standard_error.shape == (24, 24)
    files, _ = saved(measured, tmp_path / "separate")
    assert "direct.npy" in files
    with krylux.open(SCENES / "corner" / "scene.glb", size=12, spp=16, split_bounces=True, progress=False) as lab:
        layers = lab.separate(bounces=True, probes=0)
        assert np.allclose(layers.second + layers.rest, layers.global_, rtol=1e-4, atol=1e-6)


def test_probe_estimates_the_indirect_light(zigzag, tmp_path):
    found = zigzag.probe("indirect", photos=60)
    assert found.truth.shape == found.values.shape == (24, 24)
    # The relative error is about the stated one; three times that would be a wrong estimate.
    assert found.error < 3 * found.noise
    saved(found, tmp_path / "probe")


def test_probe_takes_masks_by_name_as_sparse_matrices_and_as_pairs(zigzag):
    pixel = np.arange(576)
    weights = scipy.sparse.csr_matrix((pixel[:, None] // 24 == pixel // 24).astype(float))
    rows = np.eye(24).repeat(24, axis=1)
    row = zigzag.probe(mask="row")
    assert row.photos == 24 and row.paths == "row" and row.error < 1e-6
    for mask in (weights, (rows, rows)):
        found = zigzag.probe(mask=mask)
        assert found.photos == 24 and np.allclose(found.values, row.values, rtol=1e-6)
    for wrong in (weights[:5], 3.0, (rows, rows[:3])):
        with pytest.raises(krylux.errors.Error):
            zigzag.probe(mask=wrong)


def test_relight_predicts_photos_that_were_not_taken(zigzag, tmp_path):
    pattern = np.zeros((24, 24))
    pattern[:, :12] = 1
    found = zigzag.relight({"left": pattern, "white": np.ones((24, 24))}, duals={"left": pattern}, photos=40)
    assert found.errors["left"] < 0.05 and found.rank == 40
    assert np.allclose(found.relit["white"], zigzag.white, rtol=1e-3)
    basis, photos = found.model[0]
    assert np.allclose(basis @ basis.T, np.eye(40), atol=1e-8) and photos.shape == (40, 576)
    saved(found, tmp_path / "relight")
    with krylux.open(tmp_path / "relight") as run:
        again = run.relight({"left": pattern})
        assert np.array_equal(again.relit["left"], found.relit["left"])
        with pytest.raises(krylux.errors.OptionError, match="captured already"):
            run.relight({"left": pattern}, photos=3)
    by_model = zigzag.compensate(np.full((24, 24), 0.5), model=tmp_path / "relight", photos=3)
    assert by_model.residual < 0.5 * by_model.uncompensated_residual and by_model.photos <= 3


def test_audit_passes_a_simulator_and_finds_an_asymmetric_matrix(zigzag, tmp_path):
    good = zigzag.audit()
    assert good.passed and good.white.shape == (24, 24)
    assert {"additivity", "homogeneity"} <= {check["name"] for check in good.checks}
    saved(good, tmp_path / "audit")
    asymmetric = krylux.open(np.triu(np.ones((16, 16))), size=4).audit()
    assert not asymmetric.passed


def test_solve_solves(tmp_path):
    matrix = np.diag(np.arange(1.0, 9.0))
    found = krylux.open(matrix).solve(np.ones(8), photos=8, rtol=1e-12)
    assert np.allclose(found.x, 1 / np.arange(1.0, 9.0)) and found.photos == 8
    saved(krylux.open(matrix).solve(np.ones(8)), tmp_path / "solve")


def test_a_rig_is_calibrated_checked_and_aligned(ideal_rig, tmp_path):
    options = {"size": 24, "spp": 16, "progress": False}
    calibrated = krylux.rig.calibrate(ideal_rig, tmp_path / "calibration", **options)
    assert calibrated.folder == tmp_path / "calibration" and calibrated.effort["taken"] > 10
    assert calibrated.report["camera"]["linear"] is True and len(calibrated.lines) > 3
    with pytest.raises(krylux.errors.OptionError, match="names no calibration"):
        krylux.rig.flat_field(ideal_rig, **options)
    named = tmp_path / "named.toml"
    text = ideal_rig.read_text().replace('file = "../', f'file = "{ideal_rig.parent.parent}/')
    named.write_text(f'calibration = "calibration"\n{text}')
    uneven = krylux.rig.flat_field(named, **options)
    # Ideal devices are even, but for the noise of one photo.
    assert uneven.folder == calibrated.folder and uneven.projector.size == 24 * 24
    assert np.ptp(uneven.projector) < 0.05 and np.ptp(uneven.camera) < 0.05
    checked = krylux.rig.check(ideal_rig, tmp_path, **options)
    assert checked.complete and {"file", "camera"} <= {finding["name"] for finding in checked.findings}
    (round_,) = krylux.rig.align(ideal_rig, **options)
    assert round_.found and round_.white.shape == round_.sights.shape
    with pytest.raises(krylux.errors.OptionError, match="is no rig"):
        krylux.rig.check(SCENES / "corner" / "scene.glb", tmp_path)
