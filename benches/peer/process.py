"""Running programs and measuring them from outside: wall time, processor time, peak memory."""
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path


@dataclass
class Usage:
    wall: float  # seconds
    cpu: float  # seconds, user and system, all threads
    peak: float  # MiB

    def __sub__(self, other):
        return Usage(self.wall - other.wall, self.cpu - other.cpu, self.peak)

    def __truediv__(self, count):
        return Usage(self.wall / count, self.cpu / count, self.peak)


def run(command, environment=None):
    """Runs a command to its end; `SystemExit` with its stderr when it fails. Returns its usage and what it printed."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        start = time.perf_counter()
        child = subprocess.Popen([str(word) for word in command], stdout=out, stderr=err,
                                 env={**os.environ, **(environment or {})})
        _, status, used = os.wait4(child.pid, 0)
        wall = time.perf_counter() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0), err.seek(0)
        # krylux ends with 1 where eigenpairs are not resolved, which is not asked for here.
        if child.returncode not in (0, 1):
            raise SystemExit(f"{' '.join(map(str, command))}\nfailed with {child.returncode}:\n{err.read().decode()}")
        return Usage(wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024), out.read().decode()


def fresh_home(folder, name):
    """An environment in which neither program nor driver has anything cached yet."""
    home = Path(tempfile.mkdtemp(prefix=name, dir=folder))
    return {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache"), "MESA_SHADER_CACHE_DIR": str(home / "mesa"),
            "KRYLUX_CACHE": str(home / "krylux")}


class Resident:
    """The peer with its scene loaded and its kernels compiled."""

    def __init__(self, scene, size, environment):
        command = [sys.executable, str(Path(__file__).with_name("peer.py")), "serve", str(scene), str(size)]
        self.child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                      env={**os.environ, **environment})

    def product(self, way, pattern, spp, seed, out):
        """Seconds of the wall and of the processor for one product, written to `out`."""
        request = {"way": way, "pattern": str(pattern), "spp": spp, "seed": seed, "out": str(out)}
        self.child.stdin.write(json.dumps(request) + "\n")
        self.child.stdin.flush()
        answer = self.child.stdout.readline()
        if not answer:
            raise SystemExit("the peer ended early; what it says is above")
        answer = json.loads(answer)
        return Usage(answer["wall"], answer["cpu"], 0.0)

    def close(self):
        self.child.stdin.close()
        self.child.wait()
