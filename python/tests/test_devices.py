"""A camera and a projector written in Python, behind the rig traits."""

import time

import numpy as np
import pytest

import krylux
from krylux import errors

from conftest import ROOT


class Screen:
    """A projector that keeps its frame in memory, where the camera finds it."""

    name, size, bits = "screen", (6, 4), 8

    def __init__(self):
        self.levels = np.zeros((4, 6), np.uint16)

    def show(self, levels):
        assert levels.dtype == np.uint16 and levels.shape == (4, 6)
        self.levels = levels


class Eye:
    """A camera that sees each pixel, and a tenth of all light everywhere."""

    name, size, bits, exposures, simulated = "eye", (6, 4), 16, (1e-5, 1e-2), True

    def __init__(self, screen, fails_after=None):
        self.screen, self.fails_after, self.taken, self.exposure = screen, fails_after, 0, None

    def configure(self, exposure):
        self.exposure = exposure

    def capture(self):
        self.taken += 1
        if self.fails_after is not None and self.taken > self.fails_after:
            raise ConnectionResetError("the cable came off")
        light = 2.0 * self.screen.levels + 0.01 * self.screen.levels.sum()
        return np.minimum(light * 50 * (self.exposure / 1e-3), 65535).astype(np.uint16)


def rig(**options):
    screen = Screen()
    camera = Eye(screen, **options)
    return krylux.rig.ProgramRig(screen, camera, measurement={"exposures": [1e-3], "sentinel_every": 0})


def test_a_rig_of_python_has_the_eigenvalues_of_what_it_sees():
    source = rig()
    with krylux.open(source, progress=False) as lab:
        assert lab.kind == "rig" and lab.shape == (4, 6)
        values = lab.eigs(2, photos=8).values
    # 2 I plus 0.01 everywhere of 24 pixels: 2.24 once, and 2; levels are rounded to 8 bits.
    assert values[0] / values[1] == pytest.approx(2.24 / 2, rel=0.01)
    assert source.camera.taken >= 5, "white, black and at least three products"


def test_its_journal_is_whole_and_a_run_is_replayed_without_devices(tmp_path):
    source = rig(fails_after=6)
    lab = krylux.open(source, folder=tmp_path / "run", progress=False)
    with pytest.raises(ConnectionResetError, match="cable came off"):
        lab.eigs(2, photos=20)
    lab.close()
    source = rig()
    with krylux.open(source, folder=tmp_path / "run", resume=True, progress=False) as again:
        values = again.eigs(2, photos=8).values
        assert again.costs["effort"]["replayed"] == 6
    assert source.camera.taken > 0, "the photos that were missing were taken"
    with krylux.open(tmp_path / "run") as replay:
        assert np.array_equal(replay.eigs(2, photos=8).values, values)


def test_frames_that_do_not_come_are_taken_again():
    source = rig()
    inner, calls = source.camera.capture, []

    def capture():
        calls.append(1)
        return None if len(calls) % 3 == 0 else inner()

    source.camera.capture = capture
    with krylux.open(source, progress=False) as lab:
        lab.eigs(1, photos=4)
        assert lab.costs["effort"]["dropped"] > 0


def test_what_a_device_lacks_or_returns_wrongly_is_named():
    screen = Screen()
    with pytest.raises(errors.OptionError, match="camera: it has no `exposures`"):
        krylux.rig.ProgramRig(screen, screen)
    source = rig()
    for frame, text in ((np.zeros((4, 5), np.uint16), "shape"), (np.zeros((4, 6)), "float64"),
                        (np.full((4, 6), -1), "counts from -1")):
        source.camera.capture = lambda frame=frame: frame
        with krylux.open(source, progress=False) as lab, pytest.raises(errors.OptionError, match=text) as caught:
            lab.white
        assert caught.value.option == "camera.capture"
    with pytest.raises(errors.DataError, match="takez"):
        krylux.open(krylux.rig.ProgramRig(screen, Eye(screen), measurement={"takez": 2}))


def test_it_is_checked_and_calibrated_like_any_rig(tmp_path):
    class Wide(Screen):
        size = (24, 24)

        def __init__(self):
            self.levels = np.zeros((24, 24), np.uint16)

        def show(self, levels):
            self.levels = levels

    class WideEye(Eye):
        size = (24, 24)

        def capture(self):
            light = 0.5 * self.screen.levels * (self.exposure / 1e-3) + 40
            noise = np.random.default_rng(self.taken).normal(0, 2, light.shape)
            self.taken += 1
            return np.clip(100 * light + noise, 0, 65535).astype(np.uint16)

    screen = Wide()
    source = krylux.rig.ProgramRig(screen, WideEye(screen), measurement={"exposures": [1e-3]})
    assert krylux.rig.check(source, tmp_path, progress=False).findings
    found = krylux.rig.calibrate(source, tmp_path / "calibration", progress=False)
    calibrated = krylux.rig.ProgramRig(screen, WideEye(screen), measurement={"exposures": [1e-3]},
                                       calibration=found.folder)
    with krylux.open(calibrated, progress=False) as lab:
        assert lab.white.shape == (24, 24)


class Timed(Eye):
    """A camera whose exposures take their time; `shoot` returns a frame of the pattern that is on screen when it begins."""

    simulated, exposures = False, (1e-3, 0.02)

    def shoot(self):
        light = 2.0 * self.screen.levels
        started = time.monotonic()
        time.sleep(self.exposure)
        return np.minimum(light * 50, 65535).astype(np.uint16), started

    def capture(self):
        return self.shoot()[0]


class Free(Timed):
    """A camera that runs freely: each call returns the frame that was exposed before it."""

    waiting = None

    def capture(self):
        waiting, self.waiting = self.waiting, self.shoot()
        return waiting


def timed(kind):
    screen = Screen()
    return krylux.rig.ProgramRig(screen, kind(screen), measurement={"exposures": [5e-3], "sentinel_every": 0})


def test_a_camera_that_is_triggered_needs_to_say_nothing():
    pattern = np.linspace(0, 1, 24).reshape(4, 6)
    with krylux.open(timed(Timed), progress=False) as lab:
        seen = lab.photo(pattern)
        # Levels are rounded to 8 bits.
        assert np.allclose(seen / seen.max(), pattern, atol=0.5 / 255)
        assert lab.costs["effort"]["late"] == 0


def test_the_camera_of_the_readme_works_as_it_is_printed():
    screen, scope = Screen(), {}
    blocks = (ROOT / "python" / "README.md").read_text().split("```python\n")
    exec(next(block for block in blocks if "class MyCamera" in block).split("```")[0], scope)

    class Device(Timed):
        def set_exposure(self, exposure):
            self.exposure = exposure

        def trigger(self):
            self.frame, _ = self.shoot()

        def wait_for_frame(self):
            return self.frame >> 4

    class Small(scope["MyCamera"]):
        size = (6, 4)

    camera = Small(Device(screen))
    pattern = np.linspace(0, 1, 24).reshape(4, 6)
    with krylux.open(krylux.rig.ProgramRig(screen, camera, measurement={"exposures": [2e-3]}), progress=False) as lab:
        seen = lab.photo(pattern)
    # Levels are rounded to 8 bits, counts of 0 to 1593 to whole numbers.
    assert np.allclose(seen / seen.max(), pattern, atol=0.5 / 255 + 1 / 1593)


def test_frames_of_a_camera_that_runs_freely_are_of_the_pattern_or_refused():
    pattern = np.linspace(0, 1, 24).reshape(4, 6)
    with krylux.open(timed(Free), progress=False) as lab:
        for shown in (pattern, pattern[::-1], 1 - pattern):
            seen = lab.photo(shown)
            assert np.allclose(seen / seen.max(), shown, atol=1 / 255)
        assert lab.costs["effort"]["late"] >= 3, "the frame before each pattern is late"


def test_a_frame_that_was_in_flight_is_an_error_that_says_so():
    class Hasty(Timed):
        def capture(self):
            return np.zeros((4, 6), np.uint16)

    with krylux.open(timed(Hasty), progress=False) as lab, pytest.raises(errors.OptionError) as caught:
        lab.white
    assert "exposed before it was asked for" in str(caught.value) and "time.monotonic()" in caught.value.help
    assert caught.value.option == "camera.capture"


@pytest.mark.parametrize("started, text", [
    (lambda: time.monotonic() + 1, "only before"), (time.time, "only before"), (lambda: np.nan, "it is nan"),
    (lambda: None, "is no number"),
])
def test_times_that_cannot_be_are_refused(started, text):
    class Wrong(Timed):
        def capture(self):
            return self.shoot()[0], started()

    with krylux.open(timed(Wrong), progress=False) as lab, pytest.raises(errors.OptionError, match=text) as caught:
        lab.white
    assert caught.value.option == "camera.capture"


def test_a_camera_whose_frames_are_always_old_is_given_up_with_a_reason():
    class Old(Timed):
        def capture(self):
            return self.shoot()[0], time.monotonic() - 100

    with krylux.open(timed(Old), progress=False) as lab, pytest.raises(errors.RigError, match="before the pattern had settled"):
        lab.white
