"""Signals, threads, forks, progress and messages."""

import logging
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import krylux

from conftest import ROOT, SCENES, in_another_process

ZIGZAG = SCENES / "zigzag" / "scene.glb"


def test_ctrl_c_ends_a_run_whose_photos_are_kept(tmp_path):
    # A process that a shell starts in the background ignores the signal, and so do its children unless they say otherwise.
    code = """
import signal, sys, krylux
signal.signal(signal.SIGINT, signal.default_int_handler)
lab = krylux.open('assets/rigs/ideal.toml', size=24, spp=16, folder=sys.argv[1], progress=False)
lab.white
print('ready', flush=True)
try:
    while True:
        lab.segment([2], photos=300)
except KeyboardInterrupt:
    print('interrupted', flush=True)
"""
    child = subprocess.Popen([sys.executable, "-c", code, tmp_path / "run"], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.3)
    sent = time.perf_counter()
    child.send_signal(signal.SIGINT)
    assert child.stdout.readline() == "interrupted\n"
    # A photo of this rig takes some milliseconds; an analysis that is under way adds less than a second.
    assert time.perf_counter() - sent < 5
    assert child.wait(30) == 0
    with krylux.open(tmp_path / "run") as run:
        assert run.white.shape == (24, 24), "the photos that were taken are in the journal"


def test_ctrl_c_ends_tracing():
    code = """
import krylux, os, signal, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)
lab = krylux.open('assets/scenes/carton/scene.glb', size=128, spp=4096, cache=False, progress=False)
threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
start = time.perf_counter()
try:
    lab.white
except KeyboardInterrupt:
    print(time.perf_counter() - start)
"""
    # The tracer asks after each dispatch; all of these paths would take minutes.
    assert float(in_another_process(code)) < 20


def test_exceptions_of_a_callback_come_out_unchanged():
    class Enough(Exception):
        pass

    seen = []

    def progress(stage, done, total, estimate):
        seen.append((stage, done, total))
        if len(seen) == 3:
            raise Enough("three steps")

    with krylux.open(np.diag(np.arange(1.0, 50.0)), progress=progress) as lab, pytest.raises(Enough, match="three"):
        lab.eigs(2, photos=40)
    assert seen[0][0] == "photos" and len(seen) == 3


def test_a_callback_may_ask_the_laboratory_of_another_source():
    other = krylux.open(np.diag([2.0, 1.0]))
    found = []
    with krylux.open(np.diag(np.arange(1.0, 9.0)), progress=lambda *_: found.append(other.eigs(1, photos=2).values[0])) as lab:
        lab.eigs(1, photos=4)
    assert found and set(found) == {2.0}


def test_messages_go_to_the_logger_of_krylux(caplog):
    with caplog.at_level(logging.DEBUG, logger="krylux"):
        krylux.open(ROOT / "assets" / "rigs" / "ideal.toml", size=8, spp=4, progress=False).close()
    assert any("names no calibration" in record.message for record in caplog.records)


def test_bars_are_shown_where_tqdm_is_installed(capsys):
    pytest.importorskip("tqdm")
    with krylux.open(np.diag(np.arange(1.0, 30.0)), progress=True) as lab:
        lab.eigs(2, photos=20)
    assert "photos" in capsys.readouterr().err
    with krylux.open(np.diag(np.arange(1.0, 30.0)), progress=False) as lab:
        lab.eigs(2, photos=20)
    assert capsys.readouterr().err == ""


def test_two_laboratories_in_two_threads_give_the_serial_answers():
    def answer(seed):
        with krylux.open(ZIGZAG, size=16, spp=16, seed=seed, progress=False) as lab:
            return lab.segment([2], photos=12).eigenvalues

    serial, threaded = [answer(seed) for seed in (1, 2)], [None, None]

    def work(place):
        threaded[place] = answer(place + 1)

    threads = [threading.Thread(target=work, args=(place,)) for place in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    assert all(np.array_equal(one, other) for one, other in zip(serial, threaded))


def test_other_threads_run_while_light_is_traced():
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.005)

    clock = threading.Thread(target=tick)
    clock.start()
    start = time.perf_counter()
    with krylux.open(ZIGZAG, size=48, spp=64, cache=False, progress=False) as lab:
        lab.white
    end = time.perf_counter()
    done.set()
    clock.join()
    during = np.array([tick for tick in ticks if start <= tick <= end])
    # Without the lock released there would be a single gap as long as the tracing.
    assert len(during) > 5 and np.diff(during).max() < 0.5 * (end - start)


def test_threads_may_share_a_laboratory_and_an_operator(zigzag, dense):
    A, X = zigzag.operator("global"), np.random.default_rng(0).standard_normal((576, 16))
    found = [None] * 16

    def work(column):
        found[column] = A @ X[:, column]

    threads = [threading.Thread(target=work, args=(column,)) for column in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    # The products sum some hundred terms in another order than the dense product.
    assert np.allclose(np.stack(found, 1), dense @ X, rtol=1e-10, atol=1e-14) and A.photos == 16


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_a_forked_child_has_threads_of_its_own_and_no_laboratory_of_its_parent():
    out = in_another_process("""
import os, sys, numpy as np, krylux
parent = krylux.open('assets/scenes/zigzag/scene.glb', size=16, spp=16, progress=False)
true = parent.eigs(2, part='global', photos=10, tolerance=1e-8).values
matrix = parent.matrix('global')
child = os.fork()
if child == 0:
    try:
        try:
            parent.white
        except krylux.errors.ForkedError:
            own = krylux.open(matrix, progress=False).eigs(2, photos=10, tolerance=1e-8).values
            assert np.allclose(own, true, rtol=1e-12), (own, true)
            del parent
            again = krylux.open('assets/scenes/zigzag/scene.glb', size=16, spp=16, progress=False)
            assert np.array_equal(again.eigs(2, part='global', photos=10, tolerance=1e-8).values, true)
            print('child', flush=True)
            os._exit(0)
    finally:
        os._exit(1)
assert os.waitpid(child, 0)[1] == 0
assert np.array_equal(parent.eigs(2, part='global', photos=10, tolerance=1e-8).values, true)
print('parent')
""", timeout=60)
    assert out.split() == ["child", "parent"]
