"""Tries krylux on a folder of scene files that other people made, and counts what becomes of them.

    python3 tests/wild/table.py FOLDER [--program target/release/krylux] [--json FILE] [--pictures DIR]

Every .glb, .gltf and .obj file below FOLDER is given to `krylux info` and to `krylux photo --auto-camera`, each in a process of its
own with a limit on its time and its memory. The table on stdout counts the files by what they gave: a picture, a black one, an error
by its reason, or an end that no file may cause (a crash, a panic, a time-out). Exit status 1 says that there was one of the latter.

--json keeps one line for each file, --pictures a small .png of each photo. With --before FILE, an earlier --json, the table has two
columns, and the files whose outcome changed are listed on stderr. Standard library only; for Linux.
"""

import argparse
import collections
import concurrent.futures
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENES = {".glb", ".gltf", ".obj"}

# What an error says, and the reason that it counts as. The first that fits is taken. Earlier programs said some of it otherwise.
REASONS = [
    ("glTF 1.0, which has another structure", r"glTF version `1|GLB version 1 |invalid type: map, expected a sequence at line [12] "),
    ("a required extension that is not supported", r"requires the extension"),
    ("pictures in a format that is not read", r"its picture only as|is neither PNG|is not read"),
    ("a buffer that is missing", r"No such file|no such file"),
    ("a file named by an absolute path", r"only files next to the scene are read"),
    ("no surfaces: points, lines or nothing at all", r"no triangles in the scene|missing field `nodes`"),
    ("no scene in the file", r"the file has no scene|the default scene is"),
    ("several cameras", r"\d cameras: `"),
    ("not JSON, or values of wrong types", r"not a valid glTF document"),
    ("a mesh that refers to data that are not there", r"an index asks for|there is no such|not a multiple of 3|fewer than three corners"),
    ("numbers that are not finite", r"not finite|is not a finite number"),
    ("texture coordinates are missing", r"has no TEXCOORD|has no texture coordinates"),
    ("a scene that lists a child, or nodes in a circle", r"which is a child of|its own ancestor"),
    ("a buffer or elements without data", r"has neither a URI|has no data"),
    ("materials without a name, or options of maps", r"gives no name|has an option"),
    ("larger than the memory that was allowed", r"of memory, more than|there is no memory for"),
]


# What a warning says about a black picture.
DARKNESS = {
    "no surface is in view": "no surface in view",
    "backs are seen": "seen from its back",
    "colours of 0": "has a colour of 0",
    "an opacity of 0": "has an opacity of 0",
    "smooth mirrors": "a smooth mirror",
    "surfaces are far away": "m away",
}


def limited(seconds: float, memory: int):
    """Limits of a child process: processor time, address space, and no core file."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        # Two cores' worth, so that the time on the clock is what ends a process.
        resource.setrlimit(resource.RLIMIT_CPU, (int(2 * seconds) + 1,) * 2)

    return limit


def run(command: list[str], args) -> dict:
    """The status of a command, what it said, and how long it took; status None is a time-out."""
    began = time.monotonic()
    environment = dict(os.environ, KRYLUX_CACHE="", RUST_BACKTRACE="0")
    child = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        preexec_fn=limited(args.timeout, args.memory << 20),
    )
    try:
        out, err = child.communicate(timeout=args.timeout)
        status = child.returncode
    except subprocess.TimeoutExpired:
        child.kill()
        out, err = child.communicate()
        status = None
    text = [part.decode("utf8", "replace") for part in (out, err)]
    return {"status": status, "out": text[0], "err": text[1], "seconds": round(time.monotonic() - began, 2)}


# What no file may cause.
BAD = SLOW, CRASH = "takes longer than the limit", "crash or panic"


def ended_badly(done: dict) -> str | None:
    """Which of these a command did."""
    if done["status"] is None:
        return SLOW
    if done["status"] < 0 or done["status"] == 101 or "panicked at" in done["err"]:
        return CRASH
    return None


def error_of(done: dict) -> dict:
    """The error and the help that a command ended with: the last JSON object on stderr."""
    for line in reversed(done["err"].splitlines()):
        if line.startswith('{"error"'):
            said = json.loads(line)
            return {"error": said["error"], "help": said["help"]}
    return {"error": done["err"].strip(), "help": None}


def outcome(record: dict) -> str:
    """What a file gave, from what is recorded of it."""
    if record["bad"]:
        return record["bad"]
    if "error" not in record:
        if record["radiance"]["max"] > 0:
            return "gives a picture"
        said = " ".join(record["warnings"])
        known = [reason for reason, words in DARKNESS.items() if words in said]
        return f"a black picture: {', or '.join(known)}" if known else "a black picture without a reason"
    for reason, pattern in REASONS:
        if re.search(pattern, record["error"]):
            return f"error: {reason}"
    return "error: another reason"


def one(path: Path, args, folder: Path) -> dict:
    """All that is recorded of one file."""
    name = path.relative_to(args.folder)
    stem = re.sub(r"\W+", "-", str(name))
    picture = (args.pictures or folder) / f"{stem}.png"
    size = ["--size", str(args.size), "--spp", str(args.spp)]
    photo = run([args.program, "--json", "photo", str(path), "--auto-camera", *size, "-o", str(picture)], args)
    info = run([args.program, "--json", "info", str(path)], args)
    said = photo["err"].replace(f"{args.folder}/", "").splitlines()
    record = {
        "file": str(name),
        "status": photo["status"],
        "bad": ended_badly(photo),
        "warnings": [line for line in said if line.startswith(("warning: ", "note: "))],
        "seconds": photo["seconds"],
        "info": ended_badly(info) or ("described" if info["status"] == 0 else error_of(info)["error"]),
        "info_seconds": info["seconds"],
    }
    if record["bad"]:
        record["said"] = said[-5:]
    elif photo["status"] == 0:
        record["radiance"] = json.loads(photo["out"])["radiance"]
    else:
        record |= {of: text and text.replace(f"{args.folder}/", "") for of, text in error_of(photo).items()}
    return record


def table(results: list[dict], before: list[dict] | None) -> str:
    """Counts by outcome, as a table in Markdown."""
    columns = [before, results] if before else [results]
    counts = [collections.Counter(outcome(record) for record in column) for column in columns]
    order = sorted(set().union(*counts), key=lambda what: (rank(what), -counts[-1][what], what))
    head = ["what the file gave", *(["before", "after"] if before else ["files"])]
    rows = [[what, *(str(count[what]) for count in counts)] for what in order]
    rows.append(["all", *(str(len(column)) for column in columns)])
    lines = [head, ["---", *["---:"] * len(columns)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def rank(what: str) -> int:
    """Pictures first, errors next, what may not be last."""
    beginnings = ("gives", "a black", "error", "")
    return next(at for at, beginning in enumerate(beginnings) if what.startswith(beginning))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--program", default="target/release/krylux")
    parser.add_argument("--size", type=int, default=32)
    parser.add_argument("--spp", type=int, default=4)
    parser.add_argument("--timeout", type=float, default=60, help="seconds for each process")
    parser.add_argument("--memory", type=int, default=4096, help="MiB of address space for each process")
    parser.add_argument("--jobs", type=int, default=1, help="files at once; times are comparable with one")
    parser.add_argument("--json", type=Path, help="one line for each file goes here")
    parser.add_argument("--pictures", type=Path, help="a small picture of each photo goes here")
    parser.add_argument("--record", action="store_true", help="the table also becomes guide/recorded/files.md")
    parser.add_argument("--before", type=Path, help="the --json of an earlier program")
    args = parser.parse_args()
    args.program = str(Path(args.program).resolve())
    files = sorted(path for path in args.folder.rglob("*") if path.suffix.lower() in SCENES and path.is_file())
    if not files:
        print(f"no .glb, .gltf or .obj file is below {args.folder}", file=sys.stderr)
        return 2
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
    results = []
    kept = args.json.open("w") if args.json else None
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        for record in pool.map(lambda path: one(path, args, Path(folder)), files):
            results.append(record)
            if kept:
                print(json.dumps(record, ensure_ascii=False), file=kept, flush=True)
    before = [json.loads(line) for line in args.before.read_text().splitlines()] if args.before else None
    was = {record["file"]: outcome(record) for record in before or []}
    for record in results:
        name, now = record["file"], outcome(record)
        if before and was.get(name) != now:
            print(f"{name}: {was.get(name, 'not there')} -> {now}", file=sys.stderr)
    print(table(results, before))
    if args.record:
        recorded = Path(__file__).resolve().parents[2] / "guide/recorded/files.md"
        recorded.write_text(table(results, None) + "\n")
    slowest = max(results, key=lambda record: record["seconds"])
    print(f"\nThe slowest photo took {slowest['seconds']} s: {slowest['file']}")
    bad = [record for record in results if record["bad"] or record["info"] in BAD]
    for record in bad:
        print(f"{record['file']}: {record['bad']}; info: {record['info']}", file=sys.stderr)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
