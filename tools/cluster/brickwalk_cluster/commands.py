"""Studies and benchmarks: a command as several, each with a part of what it measures.

A part is measured whole, in a folder of its own, by one worker: settings that are compared with each other take turns
in one process. What was measured is then put together, and the command itself, run here, finds it and writes tables,
plots and the page. Whatever is missing it measures.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .cluster import Cluster, Failed, Progress, one_line, program, results

#: What is measured apart, where the command does not say: the option, and its values.
PARTS = {
    "study": ("--effects", ["ao", "shadow", "diffuse", "environment"]),
    "bench chc": ("--stages", ["table2", "table3", "table4", "table5", "figure5", "targets", "scale"]),
    "bench roma": (
        "--stages",
        ["speed", "ao", "resolution", "radius", "shadows", "diffuse", "out-of-core", "handover"],
    ),
    "bench dvf": ("--stages", ["points", "grid", "rays", "lanes", "masks", "modes", "flicker", "memory"]),
    "bench displacement": ("--stages", ["figure4", "figure5", "figure6", "figure8"]),
    "bench lod": ("--stages", ["quality", "walks", "diffuse", "popping", "working-set"]),
}


def _die_with_parent() -> None:
    """Linux ends this process with the worker that started it: it would measure on, and keep the folder locked."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(1, signal.SIGKILL)


def _measure(folder: str, words: list[str], output: str) -> str:
    """A task: runs the program with ``words`` in ``folder``; it goes on where an earlier one stopped."""
    try:
        os.makedirs(os.path.join(folder, output), exist_ok=True)
        done = subprocess.run(
            [program(), "-q", *words],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            preexec_fn=_die_with_parent,
        )
    except OSError as error:
        raise Failed(one_line(error)) from error
    if done.returncode:
        text = done.stderr.decode(errors="replace").strip().splitlines()
        raise Failed(text[-1].removeprefix("brickwalk: ") if text else f"the program ended with {done.returncode}")
    return output


def split(kind: str, words: Sequence[str]) -> tuple[list[str], str, list[str], Path]:
    """The words without what is split and without the folder, the option that is split, its values, and the folder."""
    option, values = PARTS[kind]
    rest, output, own = [], None, list(words)
    while own:
        word = own.pop(0)
        name, equals, value = word.partition("=")
        if name in ("-o", "--output", option):
            if not equals:
                if not own:
                    raise Failed(f"{name}: a value is missing")
                value = own.pop(0)
            if name == option:
                values = value.split(",")
            else:
                output = value
        else:
            rest.append(word)
    if output is None:
        raise Failed("-o DIR is missing: the folder for the results")
    return rest, option, values, Path(output)


def merge(output: Path, parts: Sequence[Path]) -> int:
    """Puts together what was measured in the folders ``parts``; returns the number of rows.

    Raises :class:`Failed` where they were measured with other settings or on another device.
    """
    count = 0
    for name in sorted({path.name for part in parts for path in part.glob("*.jsonl")}):
        count += _merge_lines(output, [folder / name for folder in [output, *parts]])
    for part in parts:
        for file in part.rglob("*"):
            target = output / file.relative_to(part)
            if file.is_file() and file.suffix in (".png", ".exr") and not target.exists():
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, target)
    return count


def _merge_lines(output: Path, files: Sequence[Path]) -> int:
    """Puts the lines of files with one first line into a file of the same name in ``output``."""
    header: Any = None
    lines: dict[str, None] = {}
    for file in files:
        if not file.exists():
            continue
        first, *rest = file.read_text().splitlines()
        own = json.loads(first)
        if header is not None and own != header:
            different = ", ".join(name for name in own if own[name] != header.get(name))
            raise Failed(
                f"{file}: measured with another {different} than the parts before it: times of other devices do not "
                "go into one table; give workers of one kind"
            )
        header = own
        lines.update(dict.fromkeys(rest))
    output.mkdir(parents=True, exist_ok=True)
    temporary = output / f".{files[0].name}.{os.getpid()}.tmp"
    temporary.write_text("\n".join([json.dumps(header, separators=(",", ":")), *lines]) + "\n")
    os.replace(temporary, output / files[0].name)
    return len(lines)


def measure(cluster: Cluster, kind: str, words: Sequence[str], *, is_quiet: bool = False) -> dict[str, Any]:
    """Measures ``kind``, "study" or "bench chc", with the options ``words``, on the workers of ``cluster``.

    Returns how many parts and rows there are. Raises :class:`Failed`.
    """
    rest, option, values, output = split(kind, words)
    program()
    cluster.wait_for_workers()
    progress = Progress("parts", len(values), is_quiet)
    folder, futures = os.getcwd(), []
    for value in values:
        own = str(output / "parts" / value)
        line = [*kind.split(), *rest, option, value, "-o", own]
        futures.append(cluster.client.submit(_measure, folder, line, own, pure=False))
    done = []
    for own in results(cluster.client, futures):
        done.append(Path(own))
        progress.advance(1, len(cluster.addresses()))
    rows = merge(output, sorted(done))
    line = [program(), *(["-q"] if is_quiet else []), *kind.split(), *rest, option, ",".join(values), "-o", str(output)]
    if subprocess.run(line).returncode:
        raise Failed("all parts are measured, but not put together; the same command goes on from there")
    return {"parts": len(values), "rows": rows}
