"""krylux beside Mitsuba 3, in turns. See README.md.

    python3 benches/peer/compare.py --krylux target/release/krylux
"""
import argparse
import json
import os
import tempfile
from pathlib import Path

import numpy as np

import scenes
from questions import WAYS, Both, Setup


def arguments():
    parser = argparse.ArgumentParser(description="krylux beside Mitsuba 3: time, error and memory, in turns.")
    parser.add_argument("--krylux", required=True, help="the program, a release build")
    parser.add_argument("--turns", type=int, default=5, help="turns of each measurement (%(default)s)")
    parser.add_argument("--size", type=int, default=128, help="pixels on a side (%(default)s)")
    parser.add_argument("--samples", type=int, default=64, help="samples for each pixel (%(default)s)")
    parser.add_argument("--photos", type=int, default=50, help="photos of a run (%(default)s)")
    parser.add_argument("--scenes", help="some of " + ", ".join([*scenes.SHIPPED_NAMES, scenes.BOX]) + ", with commas")
    parser.add_argument("--llvm", help="libLLVM for the peer, e.g. /usr/lib/x86_64-linux-gnu/libLLVM.so.19.1")
    parser.add_argument("--json", help="a file for every figure of every turn")
    return parser.parse_args()


def spread(values):
    values = sorted(values)
    digits = 3 if abs(np.median(values)) < 10 else 1
    return f"{np.median(values):.{digits}f} ({values[0]:.{digits}f} to {values[-1]:.{digits}f})"


class Table:
    """Figures of both, turn by turn."""

    def __init__(self):
        self.rows = {}

    def add(self, name, ours, peer):
        self.rows.setdefault(name, []).append((ours, peer))

    def figures(self):
        return {row: [[vars(ours), vars(peer)] for ours, peer in pairs] for row, pairs in self.rows.items()}

    def print(self):
        print("\n| | krylux, s | Mitsuba, s | Mitsuba / krylux, wall | the same, processor time |")
        print("|---|---|---|---|---|")
        for name, pairs in self.rows.items():
            columns = [spread([ours.wall for ours, _ in pairs]), spread([peer.wall for _, peer in pairs])]
            columns += [spread([getattr(peer, clock) / getattr(ours, clock) for ours, peer in pairs]) for clock in ("wall", "cpu")]
            print(f"| {name} | {' | '.join(columns)} |")

    def print_memory(self, name):
        ours, peers = ([usage.peak for usage in usages] for usages in zip(*self.rows[name]))
        print(f"\nPeak memory, {name}, MiB: krylux {spread(ours)}, Mitsuba {spread(peers)}")


def errors(both, photos, runs):
    """Error of a signed product at equal time, krylux / peer, for each of the peer's ways.

    The error is the spread over independent seeds, and, where a scene has mirrors, what the peer's mean misses.
    `photos` are (krylux, peer) for one photo, `runs` for a run of photos.
    """
    ours_alone = np.median([ours.wall for ours, _ in photos])
    samples = both.matched_samples(photos[len(photos) // 2][0])
    seeds = range(1, both.setup.turns + 1)
    ours = np.stack([both.krylux_photo(both.signed, seed) for seed in seeds])
    scale = np.linalg.norm(ours.mean(0))
    noise = np.sqrt(ours.var(0, ddof=1).sum())
    print(f"\nSigned product, relative error of one at {both.setup.samples} samples: krylux {noise / scale:.4f}. "
          f"The peer's in the same time ({samples} samples), and ours over it:\n")
    print("| way | peer's error | of it missed paths | krylux / peer, one product | krylux / peer, a product of the run |")
    print("|---|---|---|---|---|")
    # In the run a product costs only a share of the tracing.
    ours_in_run = np.median([ours.wall for ours, _ in runs]) / both.setup.photos
    out = {}
    for way in WAYS:
        taken, photos_of_peer = zip(*(both.peer_product(way, both.signed, samples, 10 * seed) for seed in seeds))
        peers = np.stack(photos_of_peer)
        spread_of_peer = peers.var(0, ddof=1).sum()
        noise_of_means = (spread_of_peer + noise**2) / len(seeds)
        missed = max(((peers.mean(0) - ours.mean(0)) ** 2).sum() - noise_of_means, 0.0) if both.scene.mirrors else 0.0
        time = np.median([usage.wall for usage in taken])
        # The peer's samples are independent, so that its noise goes by the root of its time.
        ratios = [noise / np.sqrt(spread_of_peer * time / own + missed) for own in (ours_alone, ours_in_run)]
        print(f"| {way} | {np.sqrt(spread_of_peer + missed) / scale:.4f} | {np.sqrt(missed) / scale:.4f} "
              f"| {ratios[0]:.3f} | {ratios[1]:.3f} |")
        out[way] = ratios
    return out


def compare(setup, name, path, keep):
    """All questions on one scene; `keep` is given the figures so far after each turn."""
    both = Both(setup, path)
    triangles = sum(len(part.triangles) for part in both.scene.parts)
    print(f"\n## {name}, {triangles} triangles, {setup.size}×{setup.size}, {setup.samples} samples, 6 surfaces", flush=True)
    distance, share = both.agreement()
    print(f"\nThe same photo? Squared distance {distance:.3f} of what noise explains; the peer has {share:.4f} of the light.")
    if both.scene.mirrors:
        print("Its path tracer has no way to the projector by a mirror: that light is missing in it, not in krylux.")
    elif not (distance < 1.2 and abs(share - 1) < 0.01):
        raise SystemExit(f"{name}: the programs do not compute the same photo, so that times would mean nothing")
    table, photos, runs = Table(), [], []
    cold = f"{setup.photos} photos, cold"
    for turn in range(setup.turns):
        photos.append(both.one_photo())
        runs.append(both.warm_run())
        table.add("one photo, warm", *photos[-1])
        table.add(cold, *both.cold_run())
        table.add(f"{setup.photos} photos, kernels cached", *runs[-1])
        table.add(f"{setup.photos} photos, kernels cached, answer checked", both.checked_run(), runs[-1][1])
        table.add(f"{setup.photos} photos, matrix cached", both.next_run(), runs[-1][1])
        table.add("start to a tiny photo", *both.start())
        keep(table.figures())
    table.print()
    table.print_memory(cold)
    keep({**table.figures(), "errors": errors(both, photos, runs)})
    both.resident.close()


def main():
    asked = arguments()
    environment = {"DRJIT_LIBLLVM_PATH": asked.llvm} if asked.llvm else {}
    with tempfile.TemporaryDirectory() as folder:
        krylux = str(Path(asked.krylux).resolve())
        setup = Setup(krylux, Path(folder), asked.size, asked.samples, asked.photos, asked.turns, environment)
        paths = scenes.paths(folder)
        names = asked.scenes.split(",") if asked.scenes else list(paths)
        unknown = [name for name in names if name not in paths]
        if unknown:
            raise SystemExit(f"--scenes: {', '.join(unknown)}: expected some of {', '.join(paths)}")
        print(f"{os.cpu_count()} cores, {asked.turns} turns, median (least to most)")
        figures = {}

        def keep(name, of_scene):
            figures[name] = of_scene
            if asked.json:
                Path(asked.json).write_text(json.dumps(figures, indent=1))

        for name in names:
            compare(setup, name, paths[name], lambda of_scene: keep(name, of_scene))


if __name__ == "__main__":
    main()
