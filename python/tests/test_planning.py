"""Plans, one scene through several devices, and what is asked of a rig before a session: as the command line says it."""

import json
import pickle

import numpy as np
import pytest

import krylux
from krylux import errors

from conftest import RIGS, SCENES


@pytest.fixture
def small_rig(tmp_path):
    """The path of a virtual rig with realistic faults before a small scene."""
    text = (RIGS / "realistic.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("calibration")]
    text = "\n".join(lines).replace('file = "../scenes', f'file = "{SCENES.parent}/scenes')
    (tmp_path / "rig.toml").write_text(text)
    return tmp_path / "rig.toml"


def test_a_plan_of_a_segmentation_is_that_of_the_command_line(ideal_rig, command_line):
    said = json.loads(command_line("plan", ideal_rig, "--size", 16, "--spp", 16, "--trials", 2, "--json", "segment",
                                   "--groups", 2, "--photos", 12))
    with krylux.open(ideal_rig, size=16, spp=16, progress=False) as lab:
        found = lab.plan("segment", [2], photos=12, trials=2)
    assert found.verb == "segment" and found.photos.shape == (2,)
    for name in ("photos", "patterns", "frames", "seconds"):
        assert getattr(found, name).mean() == pytest.approx(said[name]["mean"], rel=1e-12)
    assert {name: values.max() for name, values in found.figures.items()} == pytest.approx(
        {name: values["max"] for name, values in said["figures"].items()})
    assert found.trials == said["trials"] and found.ideal == said["ideal"]
    assert "2 trials" in repr(found) and found._repr_html_().count("<tr>") == 5 + len(found.figures)


def test_plans_of_other_verbs_predict_what_they_name(ideal_rig):
    with krylux.open(ideal_rig, size=12, spp=16, progress=False) as lab:
        pairs = lab.plan("eigs", 2, photos=20, trials=1)
        # The photos of the ideal rig are rounded to 16 bits.
        assert len(pairs.figures) == 2 and all(abs(error[0]) < 1e-2 for error in pairs.figures.values())
        target = np.full((12, 12), 0.5)
        shown = lab.plan("compensate", target, photos=8, trials=1)
        assert shown.figures["residual"][0] >= shown.ideal["relative_residual"]
        assert shown.figures["residual"][0] < shown.ideal["relative_residual_uncompensated"]


def test_what_cannot_be_planned_is_named(zigzag, ideal_rig):
    with pytest.raises(errors.OptionError, match="is no rig"):
        zigzag.plan("eigs")
    with krylux.open(ideal_rig, size=8, spp=4, progress=False) as lab:
        for call, option in (
            (lambda: lab.plan("separate"), "verb"),
            (lambda: lab.plan("segment", [2], trials=0), "trials"),
            (lambda: lab.plan("segment", [2], evidence=True), "evidence"),
            (lambda: lab.plan("segment", [2], direct="patterns"), "direct"),
            (lambda: lab.plan("segment", [2], features=[(1, 1)]), "features"),
            (lambda: lab.plan("compensate", np.ones((8, 8)), compare_methods=True), "compare_methods"),
            (lambda: lab.plan("compensate", np.ones((7, 8))), "target"),
        ):
            with pytest.raises(errors.OptionError) as caught:
                call()
            assert caught.value.option == option, caught.value
        with pytest.raises(TypeError, match="unexpected keyword argument 'group'"):
            lab.plan("segment", group=2)
    with krylux.open(ideal_rig, size=8, spp=4, channels="rgb", progress=False) as lab:
        with pytest.raises(errors.OptionError, match="target: it is coloured"):
            lab.plan("compensate", np.ones((8, 8, 3)))


def test_a_plan_is_stopped_by_its_callback(ideal_rig):
    seen = []

    def progress(stage, done, total, estimate):
        seen.append((stage, done, total))
        if stage == "trials":
            raise RuntimeError("enough")

    with krylux.open(ideal_rig, size=8, spp=4, progress=progress) as lab, pytest.raises(RuntimeError, match="enough"):
        lab.plan("eigs", 1, photos=6)
    assert seen[-1] == ("trials", 0, 3)


def test_one_scene_through_a_rig_and_exactly(small_rig, tmp_path):
    with krylux.open(SCENES / "corner" / "scene.glb", size=24, spp=16, progress=False) as exact:
        rig = exact.through_rig(small_rig)
        assert rig.kind == "rig" and rig.unit == "DN/s" and rig.shape == (24, 24)
        with pytest.raises(errors.OptionError, match="is no rig"):
            exact.calibrate()
        found = rig.calibrate(flat_field=True)
        assert found.lines and found.report["camera"]
        seen, light = rig.white.ravel(), exact.white.ravel()
        cosine = seen @ light / np.linalg.norm(seen) / np.linalg.norm(light)
        # A calibrated camera sees the same picture but for noise, in units of its own.
        assert cosine > 0.999 and not np.array_equal(seen, light)
        with pytest.raises(TypeError, match="calibrated in this process"):
            pickle.dumps(rig)


def test_a_laboratory_through_a_rig_keeps_a_run_and_can_be_pickled(ideal_rig, tmp_path):
    exact = krylux.open(SCENES / "corner" / "scene.glb", size=8, spp=8, progress=False)
    with exact.through_rig(ideal_rig, folder=tmp_path / "run") as rig:
        white = rig.white
        assert rig.folder == tmp_path / "run"
        again = pickle.loads(pickle.dumps(rig))
    assert again.kind == "rig" and np.array_equal(again.white, white)
    with krylux.open(tmp_path / "run") as run:
        assert np.array_equal(run.white, white)
    with pytest.raises(errors.OptionError, match="rig: there is no file"):
        exact.through_rig("nowhere.toml")
    with pytest.raises(errors.OptionError, match="folder"):
        exact.through_rig(ideal_rig, resume=True)
    with pytest.raises(errors.DataError, match="no scene"):
        krylux.open(np.eye(4)).through_rig(ideal_rig)


def test_attached_devices_are_those_of_the_command_line(ideal_rig, command_line):
    said = json.loads(command_line("rig", "list", ideal_rig, "--json"))
    found = krylux.rig.list(ideal_rig)
    assert (found.monitors, found.cameras, found.virtual) == (said["monitors"], said["cameras"], said["virtual"])
    assert found.virtual["camera"]["bits"] == 16
    assert krylux.rig.list().virtual is None
    with pytest.raises(errors.OptionError, match="source: .* is no rig file"):
        krylux.rig.list("scene.glb")


def test_a_preview_hands_out_frames_with_their_figures(small_rig):
    options = {"size": 16, "spp": 8, "progress": False}
    frames = [*krylux.rig.preview(small_rig, frames=3, **options)]
    assert [frame.figures["frame"] for frame in frames] == [1, 2, 3]
    last = frames[-1]
    assert last.counts.dtype == np.uint16 and last.picture.shape == (*last.counts.shape[:2], 3)
    assert frames[0].figures["focus"] is None and last.figures["focus"] > 0
    assert last.figures["brightest"] == last.counts.max() and last.figures["saturated"] == 0
    [black] = krylux.rig.preview(small_rig, np.zeros((16, 16)), frames=1, exposure=last.figures["exposure"], **options)
    assert black.counts.mean() < 0.2 * last.counts.mean()
    # The loop may end at any time; the devices are then free for the next one.
    for frame in krylux.rig.preview(small_rig, **options):
        assert frame.figures["frame"] == 1
        break
    with pytest.raises(errors.OptionError) as caught:
        next(krylux.rig.preview(small_rig, np.ones((3, 4)), **options))
    assert caught.value.option == "pattern"
    with pytest.raises(errors.OptionError, match="is no rig"):
        krylux.rig.preview("scene.glb")
