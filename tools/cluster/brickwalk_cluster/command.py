"""The command line ``brickwalk-cluster``."""

from __future__ import annotations

import argparse
import logging
import re
import sys
from collections.abc import Sequence
from typing import Any

from .cluster import Cluster, Failed, Progress, one_line
from .commands import PARTS, measure
from .conversion import convert
from .walk import walk

EPILOG = """\
Other options are passed on: brickwalk {command} --help lists them.
Exit status: 0 success, 1 failure (one line says what is wrong and what to do), 2 wrong usage.
"""

BENCHES = sorted(kind.split()[1] for kind in PARTS if " " in kind)


def parser() -> argparse.ArgumentParser:
    top = argparse.ArgumentParser(
        prog="brickwalk-cluster", description="Commands of brickwalk over a Dask cluster.", allow_abbrev=False
    )
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    own = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    where = own.add_mutually_exclusive_group()
    where.add_argument("--scheduler", metavar="ADDRESS", help="a scheduler of Dask that runs, as tcp://host:8786")
    where.add_argument(
        "--workers",
        type=_count,
        metavar="N",
        help="processes on this machine [default: one for four cores; one to measure]",
    )
    own.add_argument("-q", "--quiet", action="store_true", help="say errors only")

    def add(name: str, text: str, usage: str) -> argparse.ArgumentParser:
        more = "[--workers N | --scheduler ADDRESS] [OPTIONS]"
        return commands.add_parser(
            name,
            parents=[own],
            help=text,
            description=text.capitalize() + ".",
            usage=f"brickwalk-cluster {name} {usage} {more}",
            epilog=EPILOG.format(command=name),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )

    one = add("walk", "render frames along a camera path", "S.bricks -o DIR")
    one.add_argument(
        "--chunk",
        type=_count,
        metavar="N",
        help="frames, or --bands of them, of a task [default: eight tasks a worker]",
    )
    one.add_argument("--disk-cache", metavar="DIR,SIZE", help="keep parts of scenes from URLs in a folder")
    add("study", "measure error against run time, an effect a task", "S.bricks -o DIR")
    one = add("bench", "run benchmarks, a stage a task", "{" + ",".join(BENCHES) + "} -o DIR")
    one.add_argument("kind", choices=BENCHES, metavar="KIND", help=", ".join(BENCHES))
    _add_convert(add("convert", "convert models into one scene file", "MODEL... -o S.bricks"))
    return top


def _add_convert(one: argparse.ArgumentParser) -> None:
    """The options of a conversion: those of ``brickwalk convert``, by the names of :func:`brickwalk.convert`."""
    nothing = argparse.SUPPRESS
    one.epilog = "Options mean what they mean to brickwalk convert; a task has one thread unless --threads says more."
    one.add_argument("inputs", nargs="+", metavar="MODEL", help=".gltf, .glb, .obj, .ply, .stl, or tileset.json")
    one.add_argument("-o", "--output", required=True, metavar="S.bricks", help="the scene file")
    one.add_argument("--memory", metavar="SIZE", default=nothing, help="of a task, as 1G [default: a quarter of all]")
    one.add_argument("--threads", type=_count, metavar="N", default=nothing, help="of a task [default: 1]")
    one.add_argument(
        "--scratch", metavar="DIR", default=nothing, help="folder that all workers see [default: S.bricks's]"
    )
    one.add_argument("--brick-triangles", type=_count, metavar="N", default=nothing, help="of a brick, at most")
    one.add_argument("--lod", type=_switch, metavar="on|off", default=nothing, help="levels of detail")
    one.add_argument("--textures", choices=["bc7", "raw"], default=nothing, help="how textures are stored")
    one.add_argument(
        "--movable", type=_names, metavar="NODES", default=nothing, help="nodes that may move, with commas"
    )
    one.add_argument("--up", choices=["y", "z"], default=nothing, help="the axis that points up")
    one.add_argument("--metres", type=float, metavar="X", default=nothing, help="metres of a unit of the models")
    one.add_argument("--within", metavar="DIR", default=nothing, help="folder that models may name files of")
    one.add_argument("--fast", action="store_true", default=nothing, help="build trees sooner; tracing takes longer")
    one.add_argument(
        "--no-proxies", dest="proxies", action="store_false", default=nothing, help="no occupancy of bricks"
    )
    one.add_argument("--drop-non-finite", action="store_true", default=nothing, help="leave bad triangles out")
    one.add_argument(
        "--anew", dest="resume", action="store_false", default=nothing, help="forget an earlier, broken run"
    )


def _switch(text: str) -> bool:
    if text not in ("on", "off"):
        raise argparse.ArgumentTypeError(f"{text}: give on or off")
    return text == "on"


def _names(text: str) -> list[str]:
    return text.split(",")


def _count(text: str) -> int:
    found = re.fullmatch(r"([0-9]{1,7})([KM]?)", text)
    count = int(found[1]) * {"": 1, "K": 1000, "M": 1_000_000}[found[2]] if found else 0
    if not 1 <= count <= 1_000_000:
        raise argparse.ArgumentTypeError(f"{text}: give a whole number from 1 to 1M, as 16K")
    return count


def _do(options: argparse.Namespace, rest: list[str], cluster: Cluster) -> str:
    """Does what was asked for; what is said of it."""
    done: dict[str, Any]
    if options.command == "walk":
        done = walk(cluster, rest, chunk=options.chunk, disk_cache=options.disk_cache, is_quiet=options.quiet)
        for warning in [] if options.quiet else done["warnings"]:
            sys.stderr.write(f"brickwalk-cluster: {warning}\n")
        parts = "" if done["parts"] == done["frames"] else f" of {done['parts']} bands"
        text = f"{done['frames']} frames{parts}, {done['rendered']} rendered now in {done['seconds']:.1f} s of workers"
        return f"{text}, {done['bytes_loaded'] / 1e6:.0f} MB loaded"
    if options.command == "convert":
        return _convert(options, cluster)
    kind = options.command if options.command == "study" else f"bench {options.kind}"
    done = measure(cluster, kind, rest, is_quiet=options.quiet)
    return f"{done['parts']} parts, {done['rows']} rows"


def _convert(options: argparse.Namespace, cluster: Cluster) -> str:
    own = ("command", "scheduler", "workers", "quiet", "inputs", "output")
    settings = {name: value for name, value in vars(options).items() if name not in own}
    progress = Progress("steps", 0, options.quiet)
    cluster.wait_for_workers()

    def tell(done: int, total: int) -> None:
        progress.reach(done, total, len(cluster.addresses()))

    try:
        done = convert(cluster.client, options.inputs, options.output, progress=tell, **settings)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        raise Failed(one_line(error)) from error
    for warning in [] if options.quiet else done["warnings"]:
        sys.stderr.write(f"brickwalk-cluster: {warning}\n")
    return f"{options.output}: {done['triangles']} triangles, {done['bricks']} bricks, {done['bytes'] / 1e6:.1f} MB"


def run(words: Sequence[str] | None = None) -> int:
    """Runs the command of ``words``, those of this process by default; returns its exit status."""
    options, rest = parser().parse_known_args(words)
    if options.command == "convert" and rest:
        parser().error(f"convert has no {rest[0]}; see brickwalk-cluster convert --help")
    # What these say of a scheduler that went away, the latter if something was being sent, is many lines; ours is one.
    for name in ("distributed.client", "distributed.batched"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        shares_cores = options.command in ("walk", "convert")
        with Cluster(options.scheduler, options.workers, shares_cores=shares_cores) as cluster:
            said = _do(options, rest, cluster)
    except Failed as error:
        sys.stderr.write(f"brickwalk-cluster: {error}\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write("brickwalk-cluster: interrupted; the same command goes on where this one stopped\n")
        return 1
    if not options.quiet:
        sys.stdout.write(said + "\n")
    return 0


def main() -> None:
    """Entry point of the program."""
    sys.exit(run())


if __name__ == "__main__":
    main()
