#!/usr/bin/env python3
"""Measures what `--secondary auto` takes over exact rays and over the best fixed method, and how it errs.

Usage: tools/auto_pairs.py S.bricks... [--rates FILE] [options]

Of each effect, error and cache walks take turns: exact ones, ones by auto, and ones by the fixed method that is fastest
within the error, where there is one. Their times are compared turn by turn, and the medians of the ratios are printed,
by two clocks: processor times of whole walks, user and system, and wall times of all frames, as records have them. One
more walk by auto, along another path where one is given, measures the error of its frames against exact ones of the same rays: 100
times the root of the mean relMSE, or FLIP.
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
# What auto chooses among, as fixed methods.
FIXED = {
    "ao": {
        "roma, 32 cells": "--secondary ao=roma --roma-size 32 --roma-k 8",
        "roma, 64 cells": "--secondary ao=roma --roma-size 64 --roma-k 4",
        "roma, 128 cells": "--secondary ao=roma --roma-size 128 --roma-k 4",
        "sift, one in 4": "--secondary ao=sift --auto-one-in 4 --roma-size 64",
    },
    "shadow": {
        "roma, 32 cells": "--secondary shadow=roma --roma-size 32 --roma-shadow-k 4",
        "roma, 128 cells": "--secondary shadow=roma --roma-size 128 --roma-shadow-k 4",
    },
    "diffuse": {
        "roma, 32 cells": "--secondary diffuse=roma --roma-size 32 --roma-diffuse-k 4",
        "roma, 64 cells": "--secondary diffuse=roma --roma-size 64 --roma-diffuse-k 4",
        "roma, 128 cells": "--secondary diffuse=roma --roma-size 128 --roma-diffuse-k 4",
    },
    "environment": {
        "dvf, 20,000 points": "--secondary environment=dvf --dvf-points 20000 --dvf-count rounding",
    },
}


def walk(args, scene, effect, cache, secondary, output, more=()):
    """Seconds that a walk takes, by both clocks: the processor's, and the wall's of all frames; and its summary."""
    words = [args.program, "walk", str(scene), "-o", output, "--quality", "exact", "--adapter", args.adapter]
    words += ["--size", args.size, "--frames", str(args.frames), "--cache", cache, *ALONE[effect], *secondary, *more]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(words)}\n{said}")
    summary = json.loads(pathlib.Path(output, "summary.json").read_text())
    lines = pathlib.Path(output, "records.jsonl").read_text().splitlines()
    return (usage.ru_utime + usage.ru_stime, sum(json.loads(line)["ms"] for line in lines) / 1e3), summary


def errors(args, own, exact, error):
    """The errors of the frames of a walk against those of another, as `error` has them."""
    found = []
    for frame in sorted(pathlib.Path(own, "frames").glob("*.exr")):
        other = pathlib.Path(exact, "frames", frame.name)
        words = [args.program, "compare", frame, other, "--json"]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        compared = json.loads(done.stdout)
        found.append(100.0 * compared["rel_mse"] ** 0.5 if error.endswith("%") else compared["flip"])
    return found


def best_fixed(args, scene, effect, cache, error, folder):
    """Name and options of the fixed method that is fastest within an error; nothing where there is none."""
    exact, own, found = f"{folder}/exact", f"{folder}/fixed", []
    walk(args, scene, effect, cache, [], exact, ["--aov"])
    for name, options in FIXED[effect].items():
        seconds, _ = walk(args, scene, effect, cache, options.split(), own, ["--aov"])
        if max(errors(args, own, exact, error)) <= float(error.rstrip("%")):
            found.append((seconds[0], name, options.split()))
    return min(found)[1:] if found else None


def cell(args, scene, effect, cache, error):
    """Measures one row."""
    auto = ["--secondary", "auto", "--error", error] + (["--rates", args.rates] if args.rates else [])
    with tempfile.TemporaryDirectory() as folder:
        fixed = best_fixed(args, scene, effect, cache, error, folder) if args.fixed else None
        ways = {"auto": auto, "exact": []} | ({"fixed": fixed[1]} if fixed else {})
        ratios, summary = {"exact": [], "fixed": []}, None
        for turn in range(args.pairs):
            times = {}
            order = list(ways.items())
            for name, secondary in order[turn % len(order) :] + order[: turn % len(order)]:
                times[name], found = walk(args, scene, effect, cache, secondary, f"{folder}/{name}")
                summary = found if name == "auto" else summary
            for name in ways:
                if name != "auto":
                    ratios[name].append([own / other for own, other in zip(times["auto"], times[name], strict=True)])
        path = ["--path", args.other_path] if args.other_path else []
        _, other = walk(args, scene, effect, cache, auto, f"{folder}/auto", ["--aov", *path])
        walk(args, scene, effect, cache, [], f"{folder}/exact", ["--aov", *path])
        found = errors(args, f"{folder}/auto", f"{folder}/exact", error)
    taken = (summary or other)["secondary_auto"]["effects"][effect]
    frames = ", ".join(f"{name} {count}" for name, count in taken["frames"].items())
    columns = [pathlib.Path(scene).stem, effect, cache, error]
    for way in ["exact", "fixed"] if args.fixed else ["exact"]:
        if way == "fixed":
            columns.append(fixed[0] if fixed else "none")
        for clock in zip(*ratios[way], strict=True) if ratios[way] else [[], []]:
            columns.append(f"{statistics.median(clock):.3f}" if clock else "–")
            columns.append(f"{min(clock):.3f} to {max(clock):.3f}" if clock else "–")
    columns.append(f"{statistics.mean(found):.3g}, most {max(found):.3g}")
    print(f"| {' | '.join(columns)} | {frames} |", flush=True)


def main():
    """Reads options and measures all rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", help="scene files")
    parser.add_argument("--rates", help="file of rates; default: the user's")
    parser.add_argument("--effects", default="ao,shadow,diffuse,environment", help="effects, with commas between them")
    parser.add_argument("--errors", default="5%", help="values of --error, with commas between them")
    parser.add_argument("--caches", default="100%", help="values of --cache, with commas between them")
    parser.add_argument("--pairs", type=int, default=9, help="turns of a row; 0: errors alone")
    parser.add_argument("--frames", type=int, default=32, help="frames a walk")
    parser.add_argument("--size", default="640x360", help="pixels")
    parser.add_argument("--adapter", default="cpu", help="what renders")
    parser.add_argument("--fixed", action="store_true", help="measure the best fixed method as well")
    parser.add_argument("--no-head", action="store_true", help="print rows alone")
    parser.add_argument("--other-path", help="camera path of the walks that errors are measured of")
    parser.add_argument("--program", default="target/release/brickwalk", help="the program")
    args = parser.parse_args()
    if not args.no_head:
        clocks = ["of the turns", "frames", "of the turns"]
        beside = ["best fixed", "auto over it", *clocks] if args.fixed else []
        head = ["scene", "effect", "cache", "--error", "auto over exact", *clocks, *beside, "error", "taken"]
        print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    for scene in args.scenes:
        for effect in args.effects.split(","):
            for cache in args.caches.split(","):
                for error in args.errors.split(","):
                    cell(args, scene, effect, cache, error)


main()
