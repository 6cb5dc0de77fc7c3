"""What the tests share: sources, and the command line for comparisons."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

import krylux

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "assets" / "scenes"
RIGS = ROOT / "assets" / "rigs"

# Matrices of the tests are not kept, and none of the user's is found: each test traces what it needs.
os.environ["KRYLUX_CACHE"] = ""
os.environ.setdefault("NODEVICE_SELECT", "1")


@pytest.fixture(scope="session")
def zigzag():
    """A scene of 24×24 pixels, shared: its matrix is traced once."""
    with krylux.open(SCENES / "zigzag" / "scene.glb", size=24, spp=32, progress=False) as lab:
        yield lab


@pytest.fixture(scope="session")
def dense(zigzag):
    """The matrix of that scene's global light, dense."""
    return zigzag.matrix("global").toarray()


@pytest.fixture
def rectangular():
    """A sparse matrix of 20×30 with a seed."""
    return scipy.sparse.random_array((20, 30), density=0.3, rng=np.random.default_rng(3), format="csr")


@pytest.fixture
def ideal_rig():
    """The path of a rig file whose devices are ideal and virtual."""
    return RIGS / "ideal.toml"


@pytest.fixture(scope="session")
def command_line():
    """The program, where it was built beside the package; ``KRYLUX_PROGRAM`` names it."""
    program = os.environ.get("KRYLUX_PROGRAM")
    if not program:
        pytest.skip("KRYLUX_PROGRAM does not name the command line program to compare with")

    def run(*arguments):
        done = subprocess.run([program, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def in_another_process(code, *arguments, timeout=120, folder=ROOT, **environment):
    """Runs Python code in a fresh interpreter, and returns what it printed."""
    done = subprocess.run([sys.executable, "-c", code, *map(str, arguments)], cwd=folder, capture_output=True, text=True,
                          timeout=timeout, check=False, env={**os.environ, **environment})
    assert done.returncode == 0, done.stderr
    return done.stdout
