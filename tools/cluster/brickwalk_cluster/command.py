"""The command line ``brickwalk-cluster``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from .cluster import Cluster, Failed
from .commands import PARTS, measure
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
        "--workers", type=_count, metavar="N", help="processes on this machine [default: one for four cores; one to measure]"
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
    one.add_argument("--chunk", type=_count, metavar="N", help="frames that a task renders [default: eight tasks a worker]")
    one.add_argument("--disk-cache", metavar="DIR,SIZE", help="keep parts of scenes from URLs in a folder")
    add("study", "measure error against run time, an effect a task", "S.bricks -o DIR")
    one = add("bench", "run benchmarks, a stage a task", "{" + ",".join(BENCHES) + "} -o DIR")
    one.add_argument("kind", choices=BENCHES, metavar="KIND", help=", ".join(BENCHES))
    return top


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1_000_000:
        raise argparse.ArgumentTypeError(f"{text}: give a whole number from 1 to 1000000")
    return int(text)


def _do(options: argparse.Namespace, rest: list[str], cluster: Cluster) -> str:
    """Does what was asked for; what is said of it."""
    done: dict[str, Any]
    if options.command == "walk":
        done = walk(cluster, rest, chunk=options.chunk, disk_cache=options.disk_cache, is_quiet=options.quiet)
        for warning in [] if options.quiet else done["warnings"]:
            sys.stderr.write(f"brickwalk-cluster: {warning}\n")
        text = f"{done['frames']} frames, {done['rendered']} rendered now in {done['seconds']:.1f} s of workers"
        return f"{text}, {done['bytes_loaded'] / 1e6:.0f} MB loaded"
    kind = options.command if options.command == "study" else f"bench {options.kind}"
    done = measure(cluster, kind, rest, is_quiet=options.quiet)
    return f"{done['parts']} parts, {done['rows']} rows"


def run(words: Sequence[str] | None = None) -> int:
    """Runs the command of ``words``, those of this process by default; returns its exit status."""
    options, rest = parser().parse_known_args(words)
    try:
        shares_cores = options.command == "walk"
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
