"""What both programs are asked, in turns: the same photo, one photo, a run of photos, a signed product, a start."""
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import scenes
from process import Resident, Usage, fresh_home, run

PEER = Path(__file__).with_name("peer.py")
WAYS = ("signed", "split", "affine")


@dataclass
class Setup:
    krylux: str
    folder: Path
    size: int
    samples: int
    photos: int
    turns: int
    environment: dict  # for the peer: where LLVM is


class Both:
    """One scene in both programs."""

    def __init__(self, setup, path):
        self.setup, self.path = setup, path
        self.scene = scenes.read(path)
        self.resident = Resident(path, setup.size, setup.environment)
        self.white = self.save("white", np.ones((setup.size, setup.size)))
        # As Krylov vectors are: signed, and every pixel another.
        self.signed = self.save("signed", np.random.default_rng(1).standard_normal((setup.size, setup.size)))

    def save(self, name, pattern):
        path = self.setup.folder / f"{name}.npy"
        np.save(path, pattern.astype(np.float32))
        return path

    def krylux(self, verb, *options, size=None, samples=None, environment=None):
        common = ["--size", size or self.setup.size, "--spp", samples or self.setup.samples, "-q"]
        return run([self.setup.krylux, verb, self.path, *common, *options], environment)[0]

    def peer(self, verb, *arguments, size=None, environment=None):
        command = [sys.executable, PEER, verb, self.path, size or self.setup.size, *arguments]
        return run(command, {**self.setup.environment, **(environment or {})})[0]

    def krylux_photo(self, pattern, seed):
        out = self.setup.folder / "ours.npy"
        self.krylux("photo", "--channels", "luma", "--no-cache", "--pattern", pattern, "--seed", seed, "-o", out)
        return np.load(out).astype(float).squeeze()

    def peer_product(self, way, pattern, samples, seed):
        out = self.setup.folder / "peer.npy"
        usage = self.resident.product(way, pattern, samples, seed, out)
        return usage, np.load(out)

    def krylux_run(self, photos, *options, check=False, environment=None):
        """A Lanczos run to its last photo. The peer does not check its answer by other light paths; krylux does so only where `check` is set."""
        with tempfile.TemporaryDirectory(dir=self.setup.folder) as out:
            asked = ["--photos", photos, "--count", 1, "--tolerance", 0, "-o", out, "--overwrite"]
            asked += [] if check else ["--no-check"]
            return self.krylux("eigs", *asked, *options, environment=environment)

    # --- the questions ---

    def agreement(self):
        """Squared distance of the mean white photos, in units of what their noise explains; and the peer's share of the light."""
        seeds = range(1, 5)
        ours = np.stack([self.krylux_photo(self.white, seed) for seed in seeds])
        peers = np.stack([self.peer_product("signed", self.white, self.setup.samples, seed)[1] for seed in seeds])
        noise = (ours.var(0, ddof=1) + peers.var(0, ddof=1)).sum() / len(seeds)
        return ((ours.mean(0) - peers.mean(0)) ** 2).sum() / noise, peers.mean() / ours.mean()

    def one_photo(self):
        """A photo, tracing included, everything open and compiled: ours by the difference of two whole processes."""
        retrace = ["--operator", "retrace", "--no-cache"]
        more, few = 3, 1
        ours = (self.krylux_run(few + more, *retrace) - self.krylux_run(few, *retrace)) / more
        total = Usage(0.0, 0.0, 0.0)
        for seed in range(more):
            used, _ = self.peer_product("signed", self.signed, self.setup.samples, seed)
            total = Usage(total.wall + used.wall, total.cpu + used.cpu, 0.0)
        return ours, total / more

    def cold_run(self):
        """A whole process of all photos, nothing cached by anyone."""
        photos = self.setup.photos
        ours = self.krylux_run(photos, environment=fresh_home(self.setup.folder, "ours"))
        cold = fresh_home(self.setup.folder, "peer")
        return ours, self.peer("lanczos", self.setup.samples, photos, environment=cold)

    def warm_run(self):
        """The same with each one's kernels cached, but no matrix."""
        photos = self.setup.photos
        return self.krylux_run(photos, "--no-cache"), self.peer("lanczos", self.setup.samples, photos)

    def checked_run(self):
        """krylux's warm run, with its answer checked by light paths of another seed; to be held against the peer's warm one."""
        return self.krylux_run(self.setup.photos, "--no-cache", check=True)

    def next_run(self):
        """A second run of krylux, which finds its matrix; to be held against the peer's warm one."""
        home = fresh_home(self.setup.folder, "next")
        self.krylux_run(1, environment=home)
        return self.krylux_run(self.setup.photos, environment=home)

    def start(self):
        """From command to a first tiny photo, kernels cached."""
        out = self.setup.folder / "tiny.npy"
        ours = self.krylux("photo", "--channels", "luma", "--no-cache", "-o", out, size=16, samples=1)
        return ours, self.peer("photo", 1, out, size=16)

    def matched_samples(self, ours):
        """Samples with which a peer's photo takes about as long as one of ours did."""
        few, many = (self.peer_product("signed", self.signed, samples, 0)[0].wall
                     for samples in (self.setup.samples, 4 * self.setup.samples))
        each = max((many - few) / (3 * self.setup.samples), 1e-6)
        return max(int(self.setup.samples + (ours.wall - few) / each), 2)
