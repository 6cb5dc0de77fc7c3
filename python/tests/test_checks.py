"""Answers checked with light that they were not computed from."""

import pickle

import numpy as np
import pytest

import krylux


def test_eigenpairs_are_checked_by_another_seed(zigzag):
    found = zigzag.eigs(3, part="global", photos=20)
    checked = found.check()
    assert checked["by"] == "another-seed" and checked["error"] > 0.01 and checked["noise"] > 0.01
    for of_scene, theta in zip(checked["of_scene"], found.values, strict=True):
        # The eigenvectors fit the noise of 32 light paths.
        assert of_scene["value"] < theta and of_scene["standard_error"] > 0


def test_segmentations_have_confidence_and_are_checked(zigzag):
    found = zigzag.segment(2, photos=24)
    assert found.confidence[2].shape == found.labels[2].shape == (24, 24)
    assert np.all(found.confidence[2] <= 1) and found.confidence[2].mean() > 0.9
    checked = found.check()
    assert len(checked["of_scene"]) == len(found.eigenvalues) - 1


def test_models_and_separations_are_checked(zigzag):
    assert 0 < zigzag.relight(photos=12).check()["error"] < 0.3
    assert zigzag.separate().check()["of"] == "the photo of a checkerboard"
    target = np.full((24, 24), 0.3)
    compensated = zigzag.compensate(target, photos=6)
    checked = compensated.check()
    assert abs(checked["residual"] - compensated.residual) < 0.1
    # The photo that was predicted is the independent one, within the noise of both.
    z = (compensated.observed - checked["observed"]) / checked["standard_error"]
    assert checked["standard_error"].shape == (24, 24) and 0.5 < np.sqrt(np.mean(z**2)) < 3


def test_a_matrix_has_no_other_light_and_a_copy_no_laboratory():
    found = krylux.open(np.diag([2.0, 1.0])).eigs(1, photos=2)
    assert found.check() is None
    with pytest.raises(krylux.errors.ClosedError, match="checked"):
        pickle.loads(pickle.dumps(found)).check()
