"""The paper's figures, and the comparison of images."""

import json
import pickle

import numpy as np
import pytest

import krylux
from krylux import errors


@pytest.fixture(scope="module")
def made():
    """Three figures of which one has labels, one plots and one the photos of a run."""
    return krylux.reproduce(["fig9", "fig2", "fig4"], quick=True, progress=False)


def test_figures_have_pictures_numbers_and_photos(made):
    assert [figure.name for figure in made.figures] == ["fig2", "fig4", "fig9"] and made.quick
    principal = made["fig2"]
    assert principal.statement and principal.rig == "ideal" and principal.photos > 0
    assert all({"what", "value", "bound", "limit", "met"} <= set(check) for check in principal.checks)
    for figure in made.figures:
        for panel in figure.panels.values():
            assert panel["values"].ndim == 2 and panel["caption"]
    labels = [panel["values"] for panel in made["fig4"].panels.values() if panel["kind"] == "labels"]
    assert labels and labels[0].dtype == np.uint8 and len(np.unique(labels[0])) >= 2
    assert all(points.shape[1] == 2 for plot in principal.plots for _, points in plot["lines"])
    [strip] = made["fig9"].strips[:1]
    assert strip["patterns"].shape == strip["photos"].shape and strip["photos"].ndim == 3
    assert "Figure 2" in made._repr_html_() and "3 figures" in repr(made)
    with pytest.raises(KeyError):
        made["fig3"]


def test_saved_figures_are_those_of_the_command_line(made, tmp_path, command_line):
    assert made.save(tmp_path / "mine") == tmp_path / "mine"
    command_line("reproduce", "fig2", "fig4", "fig9", "--quick", "-o", tmp_path / "theirs")
    names = [{file.name for file in (tmp_path / folder).iterdir()} for folder in ("mine", "theirs")]
    assert names[0] == names[1] and "report.html" in names[0]

    def numbers(folder):
        figures = json.loads((tmp_path / folder / "figures.json").read_text())
        return [{**figure, "seconds": None} for figure in figures]

    assert numbers("mine") == numbers("theirs")
    for name in names[0]:
        if name.endswith(".png"):
            assert (tmp_path / "mine" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes()
    with pytest.raises(errors.OptionError, match="already holds a run"):
        made.save(tmp_path / "mine")
    with pytest.raises(errors.ClosedError, match="save them there"):
        pickle.loads(pickle.dumps(made)).save(tmp_path / "another")


def test_wrong_figures_are_named():
    for call, option in ((lambda: krylux.reproduce("fig3"), "figures"), (lambda: krylux.reproduce([]), "figures"),
                         (lambda: krylux.reproduce("fig2", rig="real"), "rig")):
        with pytest.raises(errors.OptionError) as caught:
            call()
        assert caught.value.option == option


def test_images_are_compared_by_their_definitions():
    random = np.random.default_rng(0)
    a, b = random.random((20, 16)).astype(np.float32), random.random((20, 16)).astype(np.float32)
    found, error = krylux.compare(a, b), a.astype(float) - b
    rmse = np.sqrt((error**2).mean())
    assert found.rmse == pytest.approx(rmse, rel=1e-12) and found.largest == pytest.approx(abs(error).max())
    assert found.relative_rmse == pytest.approx(np.linalg.norm(error) / np.linalg.norm(b.astype(float)))
    assert found.psnr == pytest.approx(20 * np.log10((float(b.max()) - float(b.min())) / rmse))
    assert krylux.compare(a, b, range=1).psnr == pytest.approx(-20 * np.log10(rmse))
    assert np.array_equal(found.difference, a - b) and -1 <= found.ssim <= 1
    same = krylux.compare(b, b)
    assert same.rmse == 0 and same.psnr == np.inf and same.ssim == pytest.approx(1)
    assert krylux.compare(a[:8, :8], b[:8, :8]).ssim is None
    assert "psnr" in repr(found) and "<img" in found._repr_html_()


def test_files_are_compared_as_by_the_command_line(tmp_path, command_line):
    random = np.random.default_rng(1)
    a, b = random.random((14, 12, 3)).astype(np.float32), random.random((14, 12, 3)).astype(np.float32)
    np.save(tmp_path / "a.npy", a)
    np.save(tmp_path / "b.npy", b)
    said = json.loads(command_line("compare", tmp_path / "a.npy", tmp_path / "b.npy", "--json"))
    for found in (krylux.compare(tmp_path / "a.npy", str(tmp_path / "b.npy")), krylux.compare(a.astype(float), b[:, :, :])):
        for name in ("rmse", "relative_rmse", "largest", "psnr", "ssim", "range"):
            assert getattr(found, name) == said[name], name


def test_images_that_cannot_be_compared_are_named(tmp_path):
    image = np.ones((4, 5))
    for call, kind, option in (
        (lambda: krylux.compare(image, image.T), errors.OptionError, "a"),
        (lambda: krylux.compare(image, np.ones(20)), errors.OptionError, "b"),
        (lambda: krylux.compare(np.full((4, 5), np.nan), image), errors.OptionError, "a"),
        (lambda: krylux.compare(image, image.astype(complex)), errors.ArrayError, "b"),
        (lambda: krylux.compare(image, image, range=0), errors.OptionError, "range"),
        (lambda: krylux.compare(np.ones((4, 5, 3)), image), errors.OptionError, "a"),
    ):
        with pytest.raises(kind) as caught:
            call()
        assert caught.value.option == option
    with pytest.raises(errors.ReadError, match="nowhere.npy"):
        krylux.compare(tmp_path / "nowhere.npy", image)
    (tmp_path / "image.txt").write_text("1")
    with pytest.raises(errors.DataError, match="image.txt"):
        krylux.compare(image, tmp_path / "image.txt")
