"""Runs the cases of tests/golden/matrix.txt and compares their hashes with rows.txt. Started by tools/golden.sh."""

import argparse
import concurrent.futures
import fnmatch
import hashlib
import json
import os
import pathlib
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
import time

import golden_inputs

ROOT = pathlib.Path(__file__).resolve().parent.parent
GOLDEN = ROOT / "tests" / "golden"
ROWS, MATRIX = GOLDEN / "rows.txt", GOLDEN / "matrix.txt"

# Counters that are hashed, in this order. Left out: what a clock says, rays and rays_answered (own columns), and
# counters of features that are to go.
COUNTERS = """
    frame pass cells_renewed cells_left queries queries_visible queries_interval_culled multi_queries
    multi_queries_failed queries_tightened requeries_deferred pairs_visible pairs_invisible pulled_up
    pairs_intersected tiles_from_root pairs_front_to_back tile_batches tile_batch_leaves rays_capped
    bricks_nearest_first bricks_no_longer_wanted bricks_resident_first round_trips bricks_needed bricks_hit
    bricks_loaded bricks_reloaded bricks_reloaded_frame bytes_reloaded_frame bricks_evicted cache_passes
    bricks_resident_start bricks_resident_end load_batches bytes_needed bytes_needed_missing bytes_bvh bytes_geometry
    bytes_attributes bytes_textures nodes_visited triangles_tested cache_bytes cache_used_bytes error_mean
    error_worst_tile error_pixels unresolved_pixels non_finite
""".split()
# Of `trace --json`.
TRACE_COUNTERS = "rays hits round_trips bricks_loaded bytes_bvh bytes_geometry bytes_attributes".split()

# What every walk has unless its case says otherwise.
DEFAULTS = {
    "--frames": "2",
    "--size": "96x64",
    "--tile": "16",
    "--cache": "25%",
    "--seed": "1",
    "--aov": None,
    "--quality": "exact",
}
COLUMNS = ("frames", "aovs", "counters", "rays", "answered", "files")
NONE = "-"


class Failure(Exception):
    """A run that failed; says how."""


class Skip(Exception):
    """A case that cannot run here; says why."""


class Row:
    """What a case gave: a value for each column, and the parts it was made of, to tell what differs."""

    def __init__(self):
        self.columns = dict.fromkeys(COLUMNS, NONE)
        self.parts = {}

    def __str__(self):
        return " ".join(self.columns[name] for name in COLUMNS)

    def add(self, column, parts):
        """A hash of named bytes."""
        self.parts.update({f"{column} {name}": hashed(data) for name, data in parts})
        if parts:
            self.columns[column] = hashed(b"".join(hashlib.sha256(data).digest() for _, data in parts))


def hashed(data):
    return hashlib.sha256(data).hexdigest()[:12]


class Case:
    """A line of the matrix."""

    def __init__(self, line, kind):
        words = line.split(None, 3)
        self.kind, self.name, marks, self.scene = kind, words[0], words[1], words[2]
        self.options = words[3] if len(words) > 3 else ""
        self.is_quick = "q" in marks
        self.counts = "f" not in marks
        self.is_cpu_alone = "c" in marks
        self.repeats = 2 if "2" in marks else 1

    def executors(self, drivers):
        if self.kind in ("scene", "tool"):
            return [None]
        return ["cpu"] if self.is_cpu_alone else list(drivers)


def read_matrix():
    cases, scenes, macros, kind = [], {}, {}, None
    for line in MATRIX.read_text().splitlines():
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        if line.startswith("["):
            kind = line[1:-1]
        elif kind == "macro":
            name, text = line.split(None, 1)
            macros[name] = text
        else:
            for name, text in macros.items():
                line = re.sub(rf"(?<!\S){re.escape(name)}(?!\S)", lambda _, text=text: text, line)
            case = Case(line, kind)
            cases.append(case)
            if kind == "scene":
                scenes[case.name.partition("/")[2]] = case
    names = [case.name for case in cases]
    assert len(set(names)) == len(names), "names of the matrix are unique"
    return cases, scenes


class Golden:
    """Runs cases with one binary in one folder."""

    def __init__(self, binary, folder, scenes):
        self.binary, self.folder, self.scenes = binary, folder, scenes
        self.made, self.lock = {}, threading.Lock()
        self.seconds = {}
        shared = os.environ.get("BRICKWALK_SCENES")
        self.shared = pathlib.Path(shared) if shared else None
        folder.mkdir(parents=True, exist_ok=True)
        self.inputs = folder / "inputs"
        golden_inputs.write(self.inputs)

    def call(self, words):
        """Standard output of the binary."""
        command = [self.binary, *map(str, words)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=900, cwd=self.folder, check=False)
        except subprocess.TimeoutExpired as error:
            raise Failure(f"no end after 900 s: {shlex.join(command)}") from error
        if done.returncode != 0:
            last = (done.stderr.decode(errors="replace").strip().splitlines() or ["nothing on standard error"])[-1]
            raise Failure(f"exit {done.returncode}: {last}: {shlex.join(command)}")
        return done.stdout

    def drivers(self):
        """Executors that are here, with the name that rows have for their driver."""
        listed = json.loads(self.call(["adapters", "--json"]))["adapters"]
        found = {"cpu": f"cpu-{platform.machine()}"}
        for adapter in listed:
            if adapter["driver"] == "llvmpipe":
                numbers = re.findall(r"[\d.]*\d", f"{adapter['driver_info']} {adapter['name'].rpartition(',')[2]}")
                found["llvmpipe"] = "llvmpipe-" + "-".join(numbers)
        return found

    def expand(self, text, base=None, output=None):
        """Words of options with what they stand for."""
        if "{shared}" in text and self.shared is None:
            raise Skip("BRICKWALK_SCENES is not set")
        values = {"inputs": self.inputs, "shared": self.shared, "root": ROOT, "scene": base, "out": output}
        words = shlex.split(text)
        return [re.sub(r"\{(\w+)\}", lambda found: str(values[found.group(1)]), word) for word in words]

    def bricks(self, name):
        """The scene of this name, made once."""
        with self.lock:
            entry = self.made.setdefault(name, {"lock": threading.Lock()})
        with entry["lock"]:
            if "path" not in entry and "error" not in entry:
                try:
                    entry["path"] = self.make(name)
                except (Failure, Skip) as error:
                    entry["error"] = error
        if "error" in entry:
            raise entry["error"]
        return entry["path"]

    def make(self, name):
        case = self.scenes[name]
        words = self.expand(case.options)
        if case.scene == "convert":
            missing = [word for word in words if not word.startswith("-") and "/" in word and not os.path.exists(word)]
            if missing:
                raise Skip(f"{missing[0]} is missing")
        path = self.folder / f"{name}.bricks"
        self.call([case.scene, *words, "-o", path])
        return path

    def run(self, case, executor, keep):
        """The row of a case."""
        output = keep / f"{case.name.replace('/', '-')}{'-' + executor if executor else ''}"
        return getattr(self, f"run_{case.kind}")(case, executor, output)

    def run_scene(self, case, _executor, _output):
        path = self.bricks(case.name.partition("/")[2])
        beside = sorted(file for file in self.folder.glob(f"{path.stem}.*.json"))
        row = Row()
        row.add("files", [(file.name, file.read_bytes()) for file in [path, *beside]])
        return row

    def run_tool(self, case, _executor, _output):
        # By its name alone, which the working folder has: output names the file.
        base = self.bricks(case.scene).stem
        row = Row()
        row.add("files", [("standard output", self.call(self.expand(case.options, base)))])
        return row

    def run_trace(self, case, executor, output):
        path = self.bricks(case.scene)
        output.mkdir(parents=True, exist_ok=True)
        hits = output / "hits.npy"
        words = self.expand(case.options, path.with_suffix(""), output)
        said = self.call(["trace", path, "--adapter", executor, "--json", *words, "-o", hits])
        row = Row()
        row.add("files", [(hits.name, hits.read_bytes())])
        record = json.loads(said)
        if case.counts:
            row.add("counters", [(name, repr(record.get(name)).encode()) for name in TRACE_COUNTERS])
        row.columns["rays"] = str(record["rays"])
        return row

    def run_walk(self, case, executor, output):
        path = self.bricks(case.scene)
        output.mkdir(parents=True, exist_ok=True)
        base = path.with_suffix("")
        words = self.expand(case.options, base, output)
        if "--path" not in words and base.with_suffix(".near.json").exists():
            words += ["--path", str(base.with_suffix(".near.json"))]
        for option, value in DEFAULTS.items():
            if option not in words and not (option == "--aov" and "--taa" in words):
                words += [option] if value is None else [option, value]
        row = Row()
        frames, aovs, counters, files, sums = [], [], [], [], {"rays": 0, "rays_answered": 0}
        for repeat in range(case.repeats):
            walked = output / f"walk{repeat}"
            self.call(["walk", path, "-o", walked, "--adapter", executor, *words])
            named = [(f"{repeat} {file.name}", file) for file in sorted((walked / "frames").iterdir())]
            frames += [(name, file.read_bytes()) for name, file in named if file.suffix == ".png"]
            aovs += [(name, file.read_bytes()) for name, file in named if file.suffix == ".exr"]
            for line in (walked / "records.jsonl").read_text().splitlines():
                record = json.loads(line)
                of = f"{repeat} frame {record['frame']} {record['pass']}"
                counters += [(f"{of} {name}", repr(record.get(name)).encode()) for name in COUNTERS]
                for name in sums:
                    sums[name] += record.get(name, 0)
        for file in sorted(output.iterdir()):
            if file.is_file():
                files.append((file.name, file.read_bytes()))
        row.add("frames", frames)
        row.add("aovs", aovs)
        if case.counts:
            row.add("counters", counters)
            row.values = {f"counters {name}": data.decode() for name, data in counters}
        row.add("files", files)
        row.columns["rays"], row.columns["answered"] = str(sums["rays"]), str(sums["rays_answered"])
        shutil.rmtree(output)
        return row


def parse_rows(text):
    rows = {}
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            name, rest = line.split(None, 1)
            rows[name] = " ".join(rest.split())
    return rows


def read_rows():
    return parse_rows(ROWS.read_text()) if ROWS.exists() else {}


HEAD = """\
# Hashes of what tools/golden.sh renders; the cases are in matrix.txt. Written by tools/golden.sh --write.
# A hash that changes is explained in the message of the commit that changes it.
"""


def render_rows(rows):
    width = max(len(name) for name in rows)
    head = f"# {'name':<{width - 2}} " + " ".join(f"{name:<12}" for name in COLUMNS)
    lines = [f"{name:<{width}} " + " ".join(f"{value:<12}" for value in rows[name].split()) for name in sorted(rows)]
    return HEAD + "\n".join(line.rstrip() for line in [head, *lines]) + "\n"


def full_name(case, executor, drivers):
    driver = drivers[executor] if executor else f"host-{platform.machine()}"
    return f"{driver}/{case.name}"


def difference(expected, found):
    """Columns that differ, in words."""
    pairs = zip(COLUMNS, expected.split(), found.split())
    return ", ".join(f"{name} {a} -> {b}" for name, a, b in pairs if a != b)


def explain(ours, theirs):
    """Parts that differ between two rows, the first few."""
    values = [getattr(row, "values", {}) for row in (theirs, ours)]
    lines = []
    for name in dict.fromkeys([*theirs.parts, *ours.parts]):
        a, b = theirs.parts.get(name), ours.parts.get(name)
        if a != b:
            shown = [values[0].get(name, a), values[1].get(name, b)]
            lines.append(f"    {name}: {shown[0]} -> {shown[1]}")
    return lines[:40] + ([f"    and {len(lines) - 40} more"] if len(lines) > 40 else [])


def run_all(golden, jobs, selected, report):
    """Runs (case, executor, name) triples; a dictionary of rows, failures and skips by name."""
    results = {}
    with tempfile.TemporaryDirectory(dir=golden.folder) as keep:

        def one(item):
            case, executor, name = item
            start = time.monotonic()
            try:
                result = golden.run(case, executor, pathlib.Path(keep))
            except (Failure, Skip) as error:
                result = error
            golden.seconds[name] = time.monotonic() - start
            return name, result

        with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
            for done, (name, result) in enumerate(pool.map(one, selected), 1):
                results[name] = result
                report(done, len(selected), name)
    return results


def progress(done, count, name):
    if sys.stderr.isatty():
        end = "\n" if done == count else ""
        print(f"\r\x1b[K{done}/{count} {name}", end=end, file=sys.stderr, flush=True)


def self_check(binary, folder, scenes, drivers):
    """Whether rows repeat, and change where they must."""
    wrong = []

    def check(is_right, what):
        print(f"{'ok' if is_right else 'WRONG'}: {what}")
        if not is_right:
            wrong.append(what)

    def case(options):
        return Case(f"self q city --schedule chc --effects shadow,ao --ao-rays 2 {options}", "walk")

    for executor in drivers:
        golden = Golden(binary, folder / executor, scenes)
        options = ("", "", "--seed 2", "--cache 60%", "--exposure 0.1", "--count")
        rows = [golden.run(case(text), executor, golden.folder / f"keep{i}").columns for i, text in enumerate(options)]
        first, again, seed, cache, exposure, counted = rows
        check(first == again, f"{executor}: a second run gives the same row")
        check(
            all(first[name] != seed[name] for name in ("frames", "aovs", "counters")),
            f"{executor}: another seed changes frames, AOVs and counters",
        )
        same = all(first[name] == cache[name] for name in ("frames", "aovs", "rays"))
        check(same and first["counters"] != cache["counters"], f"{executor}: another cache changes counters alone")
        same = all(first[name] == exposure[name] for name in ("aovs", "counters", "rays"))
        check(same and first["frames"] != exposure["frames"], f"{executor}: another exposure changes frames alone")
        check(first["counters"] != counted["counters"], f"{executor}: one counter more changes counters")
    name = "host/self"
    expected = {name: "a b c 1 2 d"}
    check(parse_rows(render_rows(expected)) == expected, "rows are read as they were written")
    check(difference(expected[name], "a b c 1 3 d") == "answered 2 -> 3", "a column that differs is named")
    return 1 if wrong else 0


def matches(case, name, patterns):
    """Whether a row is asked for: by its name, a part of it, or the name of its scene."""
    return not patterns or any(fnmatch.fnmatchcase(name, one) or one in name or one == case.scene for one in patterns)


def main():
    parser = argparse.ArgumentParser(
        prog="golden.sh", description="Compares what small walks render with tests/golden/rows.txt."
    )
    parser.add_argument("--write", action="store_true", help="write the rows instead of comparing them")
    only = "the rows whose name matches a shell pattern or contains it, or of this scene; may be given several times"
    parser.add_argument("--only", metavar="PATTERN", action="append", default=[], help=only)
    parser.add_argument("--quick", action="store_true", help="a subset that touches every part")
    parser.add_argument("--against", metavar="BINARY", help="compare with this binary, and say what differs")
    parser.add_argument("--self-check", action="store_true", help="check that rows repeat and catch changes")
    parser.add_argument("--list", action="store_true", help="print the names of the rows")
    parser.add_argument(
        "--times", action="store_true", help="print the 25 slowest runs, with the making of their scenes"
    )
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), metavar="N", help="runs at a time [default: one per core]"
    )
    args = parser.parse_args()

    binary = os.path.abspath(os.environ.get("BRICKWALK_BIN", ROOT / "target" / "release" / "brickwalk"))
    if not os.access(binary, os.X_OK):
        parser.error(f"{binary} is no binary; set BRICKWALK_BIN")
    cases, scenes = read_matrix()
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        golden = Golden(binary, pathlib.Path(folder) / "ours", scenes)
        drivers = golden.drivers()
        if "llvmpipe" not in drivers:
            print("skipped: no software Vulkan here (llvmpipe)")
        if args.self_check:
            return self_check(binary, pathlib.Path(folder), scenes, drivers)
        selected = [
            (case, executor, full_name(case, executor, drivers))
            for case in cases
            if case.is_quick or not args.quick
            for executor in case.executors(drivers)
        ]
        selected = [item for item in selected if matches(item[0], item[2], args.only)]
        if args.list:
            print("\n".join(name for _, _, name in selected))
            return 0
        if not selected:
            parser.error(f"no row matches {' '.join(args.only)}")
        committed = read_rows()
        # A driver without a row is another one than those the rows were written with.
        known = {name.partition("/")[0] for name in committed}
        others = [] if args.write or args.against else sorted({n.partition("/")[0] for _, _, n in selected} - known)
        for driver in others:
            count = sum(name.startswith(f"{driver}/") for _, _, name in selected)
            print(f"skipped: {count} rows of {driver}: other driver, the rows are of {', '.join(sorted(known))}")
        selected = [item for item in selected if item[2].partition("/")[0] not in others]
        found = run_all(golden, args.jobs, selected, progress)
        theirs = {}
        if args.against:
            other = Golden(os.path.abspath(args.against), pathlib.Path(folder) / "theirs", scenes)
            theirs = run_all(other, args.jobs, selected, progress)
        is_whole = not args.quick and not args.only
        if args.times:
            slowest = sorted(golden.seconds.items(), key=lambda item: -item[1])
            print("\n".join(f"{seconds:6.1f} s  {name}" for name, seconds in slowest[:25]))
        status = finish(args, found, theirs, committed, set(drivers.values()), is_whole)
    print(f"{time.monotonic() - start:.0f} s")
    return status


def finish(args, found, theirs, committed, drivers, is_whole):
    """Reports, or writes, what was found; the exit status."""
    skips = {name: str(row) for name, row in found.items() if isinstance(row, Skip)}
    failures = {name: str(row) for name, row in found.items() if isinstance(row, Failure)}
    rows = {name: row for name, row in found.items() if isinstance(row, Row)}
    for name, why in skips.items():
        print(f"skipped: {name}: {why}")
    for name, why in failures.items():
        print(f"FAILED: {name}: {why}")
    if args.write:
        # Read again: another run may have written other rows meanwhile.
        committed = read_rows()
        if failures:
            print("nothing is written")
            return 1
        here = drivers | {f"host-{platform.machine()}"}
        kept = {
            name: row
            for name, row in committed.items()
            if not is_whole or name in skips or name.partition("/")[0] not in here
        }
        ROWS.write_text(render_rows(kept | {name: str(row) for name, row in rows.items()}))
        print(f"{len(rows)} rows written to {ROWS.relative_to(ROOT)}")
        return 0
    differ = 0
    for name, row in rows.items():
        expected = theirs.get(name) if args.against else committed.get(name)
        if expected is None:
            print(f"NEW: {name}: no such row; tools/golden.sh --write --only {name}")
        elif str(expected) != str(row):
            failed = isinstance(expected, Exception)
            print(f"DIFFERS: {name}: {expected if failed else difference(str(expected), str(row))}")
            if isinstance(expected, Row):
                print("\n".join(explain(row, expected)))
        else:
            continue
        differ += 1
    if is_whole and not args.against:
        stale = [name for name in committed if name not in found and name.partition("/")[0] in drivers]
        for name in stale:
            print(f"GONE: {name}: a row without a case")
        differ += len(stale)
    print(f"{len(rows) - differ} rows are the same, {differ} differ, {len(failures)} failed, {len(skips)} skipped")
    return 1 if differ or failures else 0


if __name__ == "__main__":
    sys.exit(main())
