#!/usr/bin/env python3
"""Measures what `--secondary auto` takes over exact rays, and how it errs.

Usage: tools/auto_pairs.py S.bricks... [--rates FILE] [options]

Of each effect, error and cache two walks take turns, one exact and one by auto; their processor times (user and system)
are compared pair by pair, and the medians are printed. A third walk by auto, along another path where one is given,
measures the error of its frames against exact ones of the same rays: 100 times the root of the mean relMSE.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

ALONE = {
    "ao": ["--effects", "ao", "--sun-intensity", "0", "--ao-rays", "4"],
    "shadow": ["--effects", "shadow", "--sky-intensity", "0"],
    "diffuse": ["--effects", "shadow,diffuse", "--sky-intensity", "0", "--diffuse-rays", "2"],
    "environment": ["--effects", "environment", "--environment", "sky"],
}


def walk(args, scene, effect, cache, secondary, output, more=()):
    """Seconds of the processor that a walk takes, and its summary."""
    words = [args.program, "walk", str(scene), "-o", output, "--quality", "exact", "--adapter", args.adapter]
    words += ["--size", args.size, "--frames", str(args.frames), "--cache", cache, *ALONE[effect], *secondary, *more]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(words)}\n{said}")
    return usage.ru_utime + usage.ru_stime, json.loads(pathlib.Path(output, "summary.json").read_text())


def errors(args, own, exact):
    """The errors of the frames of a walk against those of another, in percent, by `brickwalk compare`."""
    found = []
    for frame in sorted(pathlib.Path(own, "frames").glob("*.exr")):
        other = pathlib.Path(exact, "frames", frame.name)
        words = [args.program, "compare", frame, other, "--json"]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        found.append(100.0 * json.loads(done.stdout)["rel_mse"] ** 0.5)
    return found


def cell(args, scene, effect, cache, error):
    """Measures one row."""
    auto = ["--secondary", "auto", "--error", error] + (["--rates", args.rates] if args.rates else [])
    with tempfile.TemporaryDirectory() as folder:
        a, b = f"{folder}/auto", f"{folder}/exact"
        ratios, summary = [], None
        for turn in range(args.pairs):
            ways = [(auto, a), ([], b)]
            times = {}
            for secondary, output in ways if turn % 2 == 0 else reversed(ways):
                times[output], found = walk(args, scene, effect, cache, secondary, output)
                summary = found if output == a else summary
            ratios.append(times[a] / times[b])
        path = ["--path", args.other_path] if args.other_path else []
        walk(args, scene, effect, cache, auto, a, ["--aov", *path])
        walk(args, scene, effect, cache, [], b, ["--aov", *path])
        found = errors(args, a, b)
    taken = summary["secondary_auto"]["effects"][effect]
    frames = ", ".join(f"{name} {count}" for name, count in taken["frames"].items())
    print(
        f"| {pathlib.Path(scene).stem} | {effect} | {cache} | {error} | {statistics.median(ratios):.3f} "
        f"| {min(ratios):.3f} to {max(ratios):.3f} | {statistics.mean(found):.2f}, most {max(found):.2f} | {frames} |",
        flush=True,
    )


def main():
    """Reads options and measures all rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", help="scene files")
    parser.add_argument("--rates", help="file of rates; default: the user's")
    parser.add_argument("--effects", default="ao,shadow,diffuse,environment", help="effects, with commas between them")
    parser.add_argument("--errors", default="5%", help="values of --error, with commas between them")
    parser.add_argument("--caches", default="100%", help="values of --cache, with commas between them")
    parser.add_argument("--pairs", type=int, default=9, help="pairs of walks a row")
    parser.add_argument("--frames", type=int, default=32, help="frames a walk")
    parser.add_argument("--size", default="640x360", help="pixels")
    parser.add_argument("--adapter", default="cpu", help="what renders")
    parser.add_argument("--other-path", help="camera path of the walks that errors are measured of")
    parser.add_argument("--program", default="target/release/brickwalk", help="the program")
    args = parser.parse_args()
    print("| scene | effect | cache | --error | auto over exact | of the pairs | error, % | frames |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for scene in args.scenes:
        for effect in args.effects.split(","):
            for cache in args.caches.split(","):
                for error in args.errors.split(","):
                    cell(args, scene, effect, cache, error)


main()
