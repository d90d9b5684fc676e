#!/usr/bin/env bash
# Renders a matrix of small walks with the release binary, through its command line alone, and compares hashes of the
# output with tests/golden/rows.txt. Exit status: 0 all rows are the same, 1 some differ or a run failed, 2 wrong usage.
#
#   tools/golden.sh                    check all rows (about 5 minutes on two cores)
#   tools/golden.sh --quick            check a subset that touches every part (about a minute)
#   tools/golden.sh --only PATTERN     check the rows whose name matches a shell pattern or contains it, or of a scene;
#                                      may be given several times
#   tools/golden.sh --write            write the rows; with --only or --quick those alone
#   tools/golden.sh --against BINARY   compare with another binary, and say which frames and counters differ
#   tools/golden.sh --self-check       check that rows repeat, and change with a seed, a cache and a counter
#   tools/golden.sh --list             print the names of the rows
#
# BRICKWALK_BIN names the binary to check [default: a release build of this checkout]. BRICKWALK_SCENES is a folder of
# scene files; without it the rows that need one are skipped. The name of a row begins with its driver; rows of another
# driver are skipped. Cases: tests/golden/matrix.txt.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

have python3 || fail "python3 is missing; install Python 3"
if [ -z "${BRICKWALK_SCENES:-}" ] && [ -d "$root/../shared/scenes" ]; then
    BRICKWALK_SCENES=$(cd "$root/../shared/scenes" && pwd)
    export BRICKWALK_SCENES
fi
if [ -z "${BRICKWALK_BIN:-}" ]; then
    prepare tests
    cargo build --release --quiet --manifest-path "$root/Cargo.toml"
    BRICKWALK_BIN=${CARGO_TARGET_DIR:-$root/target}/release/brickwalk
    export BRICKWALK_BIN
fi
exec python3 -B "$root/tools/golden.py" "$@"
