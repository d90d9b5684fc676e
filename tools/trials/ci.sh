#!/usr/bin/env bash
# The short form of trials, for every change: fixed seeds, then seeds that nobody tried, whose first is printed. It
# takes less than three minutes on two cores. Options go to both runs.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root"
# With --workspace, as in tools/test.sh, so that nothing is compiled again.
cargo build --release --workspace --bin brickwalk --bin brickwalk-trials
program=target/release/brickwalk-trials

"$program" --seed 0 --minutes 1.2 "$@"
seed=$(($(od -An -N4 -tu4 /dev/urandom) + 1000000000))
echo "seed $seed"
"$program" --seed "$seed" --minutes 1.2 "$@"
