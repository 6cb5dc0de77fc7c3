"""Bad input: an exception that names the argument and what was expected; never the end of the interpreter."""

import numpy as np
import pytest
import scipy.sparse

import krylux
from krylux import errors

from conftest import ROOT, SCENES


@pytest.mark.parametrize("pattern, kind, text", [
    (np.ones((24, 23)), errors.OptionError, "pattern: its shape is (24, 23), but 24 × 24 pixels are expected"),
    (np.ones((24, 24, 2)), errors.OptionError, "pattern: its shape"),
    (np.ones((24, 24, 3)), errors.OptionError, "pattern: it is coloured, but the laboratory is gray"),
    (np.ones((24, 24), complex), errors.ArrayError, "pattern: its data type is complex128"),
    (np.full((24, 24), np.nan), errors.OptionError, "pattern: 576 of its values are NaN"),
    ("wihte", errors.OptionError, "pattern: expected white, black"),
    ("pixel:24,0", errors.OptionError, "pattern: pixel 24,0 lies outside"),
    (b"white", errors.ArrayError, "pattern: its data type"),
])
def test_wrong_patterns_are_named(zigzag, pattern, kind, text):
    with pytest.raises(kind) as caught:
        zigzag.photo(pattern)
    assert str(caught.value).startswith(text) and "\n  help: " in str(caught.value)
    assert caught.value.option == "pattern" and caught.value.help in str(caught.value)


def test_options_that_do_not_exist_are_named_as_they_were_asked_for(zigzag):
    with pytest.raises(TypeError, match=r"^segment\(\) got an unexpected keyword argument 'grups'; did you mean 'groups'\?$"):
        zigzag.segment(grups=[2])
    assert krylux.Lab.segment.__qualname__ == "Lab.segment"


def test_wrong_vectors_are_named(zigzag):
    A = zigzag.operator()
    with pytest.raises(ValueError, match="mismatch"):
        A @ np.ones(7)
    with pytest.raises(errors.OptionError, match="x: 1 of its values are NaN"):
        A @ np.where(np.arange(576) == 5, np.nan, 1.0)
    with pytest.raises(errors.ArrayError, match="data type is complex"):
        A @ np.ones(576, complex)
    with pytest.raises(errors.OptionError, match="X: 2 of its values are NaN"):
        A @ np.where(np.arange(576 * 3).reshape(576, 3) < 2, np.inf, 1.0)
    with pytest.raises(errors.OptionError, match="x: 1 of its values are NaN"):
        A @ np.where(np.arange(1152) == 10, np.nan, 1.0)[::2]
    with pytest.raises(errors.OptionError, match='part: there is no "glob"'):
        zigzag.operator("glob")


@pytest.mark.parametrize("options, option", [
    ({"size": 0}, "size"), ({"size": (4, 4, 4)}, "size"), ({"spp": -1}, "spp"), ({"spp": 1.5}, "spp"),
    ({"seed": -3}, "seed"), ({"channels": "cmyk"}, "channels"), ({"operator": "magic"}, "operator"),
    ({"products": "gpu"}, "products"), ({"sampler": "blue"}, "sampler"),
])
def test_wrong_settings_are_named(options, option):
    with pytest.raises(errors.Error) as caught:
        krylux.open(SCENES / "zigzag" / "scene.glb", **options)
    assert caught.value.option == option and caught.value.help


def test_the_texts_of_krylux_name_arguments_of_python(tmp_path):
    matrix = scipy.sparse.eye_array(4)
    with pytest.raises(errors.OptionError) as caught:
        krylux.open(matrix, spp=3)
    assert caught.value.option == "spp" and "--" not in str(caught.value)
    with pytest.raises(errors.OptionError, match="^source: there is no file"):
        krylux.open(tmp_path / "nowhere.glb")
    with pytest.raises(TypeError, match="unexpected keyword argument 'sizes'"):
        krylux.open(matrix, sizes=3)
    (tmp_path / "broken.toml").write_text("kind = 3")
    with pytest.raises(errors.DataError, match="broken.toml") as caught:
        krylux.open(tmp_path / "broken.toml")
    assert caught.value.path.endswith("broken.toml")


@pytest.mark.parametrize("size", [10**5, 10**6, 2**31, 2**40])
def test_sizes_that_no_machine_holds_are_errors(size):
    # In a process of its own, because an allocation that fails would end it.
    from conftest import in_another_process

    in_another_process("""
import sys, krylux
try:
    lab = krylux.open('assets/scenes/corner/scene.glb', size=int(sys.argv[1]), spp=1, cache=False, progress=False)
    lab.white
except krylux.Error as error:
    assert error.help, error
else:
    raise AssertionError('it was traced')
""", size)


def test_wrong_questions_are_named(zigzag):
    for call, option in (
        (lambda: zigzag.segment([1]), "groups"),
        (lambda: zigzag.segment([2], photos=2), "photos"),
        (lambda: zigzag.segment([2], cut="deep"), "cut"),
        (lambda: zigzag.segment([2], features=[(99, 0)]), "features"),
        (lambda: zigzag.eigs(0), "count"),
        (lambda: zigzag.eigs(1, which="up"), "which"),
        (lambda: zigzag.compensate(2 * np.ones((24, 24))), "target"),
        (lambda: zigzag.compensate(np.ones((24, 24)), method="magic"), "method"),
        (lambda: zigzag.compensate(np.ones((24, 24)), crosstalk="measure"), "crosstalk"),
        (lambda: zigzag.probe("sideways"), "paths"),
        (lambda: zigzag.separate("magic"), "by"),
        (lambda: zigzag.relight({"a": np.ones((2, 2))}), "patterns['a']"),
        (lambda: zigzag.solve(np.ones(3)), "b"),
    ):
        with pytest.raises(errors.OptionError) as caught:
            call()
        assert caught.value.option == option


def test_a_closed_laboratory_says_so():
    lab = krylux.open(np.eye(3))
    A = lab.operator()
    lab.close()
    lab.close()
    assert lab.is_closed
    for use in (lambda: lab.white, lambda: lab.operator(), lambda: lab.eigs(1)):
        with pytest.raises(errors.ClosedError, match="open the source again"):
            use()
    assert np.array_equal(A @ np.arange(3.0), np.arange(3.0)), "operators outlive their laboratory"


def test_matrices_that_are_none_are_refused():
    for source, text in ((np.ones(3), "shape"), (np.array([[np.inf]]), "NaN or infinite"),
                         (np.array([["a"]]), "data type")):
        with pytest.raises(errors.OptionError, match=text):
            krylux.open(source)


def test_folders_that_hold_a_run_are_not_overwritten(tmp_path):
    lab = krylux.open(np.diag([2.0, 1.0]))
    lab.eigs(1, photos=2).save(tmp_path / "run")
    with pytest.raises(errors.OptionError, match="already holds a run") as caught:
        lab.eigs(1, photos=2).save(tmp_path / "run")
    assert caught.value.option == "folder"
    lab.eigs(1, photos=2).save(tmp_path / "run", overwrite=True)


def test_a_dead_rig_is_an_error(tmp_path):
    text = (ROOT / "assets" / "rigs" / "ideal.toml").read_text()
    (tmp_path / "dead.toml").write_text(text.split("[scene]")[0] + """
[scene]
file = "%s"
size = [8, 8]
samples = 4
[faults]
freeze_after = [3]
freeze_for_good = true
""" % (SCENES / "corner" / "scene.glb"))
    with pytest.raises(errors.RigError) as caught:
        krylux.open(tmp_path / "dead.toml", progress=False).white
    assert caught.value.device and caught.value.help


def test_a_fault_of_krylux_is_an_exception_and_the_interpreter_goes_on():
    from krylux import _krylux

    # No operator of the package has this shape: its vectors have more bytes than addresses, which is a panic in Rust.
    described = {"product": None, "shape": (2**62, 2**62), "symmetric": True, "block": 1, "progress": None,
                 "log": lambda *_: None}
    with pytest.raises(errors.InternalError, match="krylux failed: capacity overflow\n  help: please report it"):
        _krylux.trace(described, 2, 0, "hutchinson")
    assert krylux.open(np.eye(2)).eigs(1, photos=2).values[0] == 1


@pytest.mark.parametrize("side", [2**40, 2**62, 2**70])
def test_operators_that_claim_any_shape_are_refused(side):
    class Claim:
        shape = (side, side)

        def __matmul__(self, x):
            raise AssertionError("no product is asked for")

    for call in (lambda: krylux.krylov.eigs(Claim(), 1), lambda: krylux.krylov.trace(Claim()),
                 lambda: krylux.krylov.svd(Claim())):
        with pytest.raises(errors.OptionError, match="fits into memory") as caught:
            call()
        assert caught.value.option == "A"
    with pytest.raises(errors.OptionError, match="symmetric: A has 2 rows"):
        krylux.krylov.lsqr(np.ones((2, 3)), np.ones(2), symmetric=True)


def test_exceptions_can_be_pickled_with_their_parts(zigzag):
    import pickle

    with pytest.raises(errors.OptionError) as caught:
        zigzag.photo(np.ones(2))
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value) and copy.option == "pattern" and copy.help == caught.value.help
