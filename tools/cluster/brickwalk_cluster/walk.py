"""A walk: ranges of frames, or of bands of frames, as tasks, and what joins them.

A frame is rendered up to where earlier frames come in: filters and exposure. What joins the parts does these in the
order of the frames, so that the pictures are those of one machine (docs/cluster.md).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import brickwalk
from brickwalk import BrickwalkError, WalkParts

from .cluster import Cluster, Failed, Progress, program, results

#: What says that a walk is finished, and what its frames are.
DONE = "cluster.json"
#: Settings that no picture depends on.
WITHOUT_EFFECT = ("adapter =", "cache =", "evict =", "host_cache =", "workers =")
#: What parts took, in sum.
SUMS = ("seconds", "bytes_loaded", "requests", "bytes_fetched", "seconds_waiting")


@dataclass(frozen=True)
class Job:
    """A walk that is split. ``folder`` is where names of files count from; all workers see it."""

    folder: str
    scene: str
    output: str
    settings: str
    frames: int
    parts: int
    key: str
    disk_cache: str | None = None


def job(words: Sequence[str], disk_cache: str | None = None) -> Job:
    """The walk of these words, as ``["city.bricks", "-o", "film", "--frames", "600"]``; a model is converted first.

    Raises :class:`Failed` with what the program ``brickwalk`` says of them.
    """
    done = subprocess.run([program(), "-q", "jobs", "--format", "json", "--", "walk", *words], capture_output=True)
    if done.returncode:
        text = done.stderr.decode(errors="replace").strip().splitlines()
        raise Failed(text[-1].removeprefix("brickwalk: ") if text else "the program brickwalk failed")
    found = json.loads(done.stdout)
    return Job(
        os.getcwd(),
        found["scene"],
        found["output"],
        found["settings"],
        found["frames"],
        found.get("parts", 0),
        found.get("key", ""),
        disk_cache,
    )


#: The walk that this worker has open, with its session and cache.
_open: tuple[Job, WalkParts] | None = None


def _opened(job: Job) -> WalkParts:
    global _open
    if _open is not None and _open[0] == job:
        return _open[1]
    if _open is not None:
        _open[1].close()
        _open = None
    try:
        os.chdir(job.folder)
    except OSError as error:
        raise Failed(f"{job.folder}: this worker does not see the folder; give one that all machines share") from error
    parts = WalkParts(job.scene, job.settings, job.disk_cache)
    _open = (job, parts)
    return parts


def _render(job: Job, numbers: list[int], log: str | None = None) -> dict[str, Any]:
    """A task: renders parts, but for those that are there and whole. Returns what it took."""
    try:
        parts = _opened(job)
        rows = []
        for number in numbers:
            row = parts.render(job.output, number, None)
            rows.append(row)
            if log is not None and row["is_new"]:
                with open(log, "a") as lines:
                    lines.write(f"{number}\n")
    except (BrickwalkError, OSError, ValueError) as error:
        raise Failed(" ".join(str(error).split())) from error
    return {
        "parts": len(rows),
        "rendered": sum(row["is_new"] for row in rows),
        **{name: sum(row[name] for row in rows) for name in SUMS},
        "warnings": sorted({warning for row in rows for warning in row["warnings"]}),
    }


def ranges(parts: int, chunk: int) -> list[list[int]]:
    """All parts, ``chunk`` neighbours at a time: neighbours need much the same bricks."""
    return [list(range(first, min(first + chunk, parts))) for first in range(0, parts, chunk)]


def is_done(output: str | os.PathLike[str], key: str) -> bool:
    """Whether the walk ``key`` is finished in ``output``, and all its frames are as they were written."""
    try:
        done = json.loads((Path(output) / DONE).read_text())
        frames = done["frames"] if done["key"] == key else {}
        return bool(frames) and all(_hash(Path(output) / name) == own for name, own in frames.items())
    except (OSError, ValueError, KeyError):
        return False


def identity(key: str, settings: str) -> str:
    """What the pictures of a walk are known by: the ``key`` of its parts, and settings that count after these."""
    lines = [line for line in settings.splitlines() if not line.startswith(WITHOUT_EFFECT)]
    return f"{key}-{hashlib.sha256(chr(10).join(lines).encode()).hexdigest()[:16]}"


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _with_cache(settings: str, size: int) -> str:
    """The settings with a cache of ``size`` bytes where they leave it to the machine, which has several workers."""
    return settings if re.search(r"^cache = ", settings, re.MULTILINE) else f'cache = "{size}"\n{settings}'


def walk(
    cluster: Cluster,
    words: Sequence[str],
    *,
    chunk: int | None = None,
    disk_cache: str | None = None,
    is_quiet: bool = False,
    log: str | None = None,
) -> dict[str, Any]:
    """Renders the walk of ``words`` on the workers of ``cluster`` and joins it here.

    A part is a frame or, with ``--bands``, a band of one. ``chunk`` is how many parts a task has; by default each
    worker gets about eight tasks. ``log`` is a file that gets the number of each part that is rendered, a line each.
    Returns what was done: frames, parts, those that were rendered, seconds of workers, bytes loaded; of a scene by
    URL requests, bytes fetched and seconds of waiting for them.

    Raises :class:`Failed`.
    """
    own = job(words, disk_cache)
    try:
        parts = WalkParts(own.scene, own.settings, disk_cache)
    except (BrickwalkError, OSError, ValueError) as error:
        raise Failed(" ".join(str(error).split())) from error
    parts.close()
    if parts.key != own.key:
        raise Failed(f"{program()} and the package brickwalk are of different commits; install both from one")
    key = identity(parts.key, own.settings)
    if is_done(own.output, key):
        none = {"parts": own.parts, "rendered": 0}
        return {"key": key, "frames": own.frames, **none, **dict.fromkeys(SUMS, 0), "warnings": []}
    share = cluster.share_of_memory()
    split = own if share is None else Job(**{**own.__dict__, "settings": _with_cache(own.settings, share)})
    cluster.wait_for_workers()
    addresses = cluster.addresses()
    tasks = ranges(own.parts, chunk or max(1, -(-own.parts // (8 * len(addresses)))))
    progress = Progress("frames" if own.parts == own.frames else "bands", own.parts, is_quiet)
    total: dict[str, Any] = {"key": key, "frames": own.frames, "parts": 0, "rendered": 0, **dict.fromkeys(SUMS, 0)}
    warnings: set[str] = set()
    # Each worker begins on a stretch of the path of its own: bricks of one task are those of the next.
    stretch = -(-len(tasks) // len(addresses))
    futures = [
        cluster.client.submit(
            _render,
            split,
            numbers,
            log,
            pure=False,
            workers=[addresses[number // stretch]],
            allow_other_workers=True,
        )
        for number, numbers in enumerate(tasks)
    ]
    for row in results(cluster.client, futures):
        for name in ("parts", "rendered", *SUMS):
            total[name] += row[name]
        warnings.update(row["warnings"])
        progress.advance(row["parts"], len(cluster.addresses()))
    join(words, disk_cache, is_quiet)
    frames = sorted((Path(own.output) / "frames").glob("*.*"))
    listed = {f"frames/{path.name}": _hash(path) for path in frames}
    _write(Path(own.output) / DONE, {"key": key, "version": brickwalk.__version__, "frames": listed})
    return {**total, "warnings": sorted(warnings)}


def join(words: Sequence[str], disk_cache: str | None = None, is_quiet: bool = False) -> None:
    """Joins the parts of a walk: frames, records, summary and report, as ``brickwalk walk`` writes them."""
    more = [*(["--disk-cache", disk_cache] if disk_cache else []), *(["-q"] if is_quiet else [])]
    if subprocess.run([program(), *more, "walk", *words, "--join"]).returncode:
        raise Failed("the frames are rendered, but not joined; the same command goes on from there")


def _write(path: Path, value: dict[str, Any]) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    with open(temporary, "w") as file:
        json.dump(value, file, indent=1)
        file.write("\n")
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)
