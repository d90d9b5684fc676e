#!/usr/bin/env bash
# Measures the processor's kernels against Embree, the same rays through the same triangles, in turns, and prints a
# table. Words are sizes of generated cities (default: 1M 5M). Embree 4 is the library that EMBREE names, else the
# system's, else that of the Python package embreex, which is installed under target/peer. No other program should be
# busy meanwhile.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

prepare
place="$root/target/peer"
mkdir -p "$place"
library=${EMBREE:-$(ldconfig -p 2>/dev/null | awk '/libembree4\.so/ { print $NF; exit }')}
if [ -z "$library" ]; then
    if [ ! -d "$place/venv/lib" ]; then
        python3 -m venv "$place/venv"
        "$place/venv/bin/pip" install --quiet embreex
    fi
    library=$(find "$place/venv" -name 'libembree4*.so*' -print -quit)
fi
[ -e "$library" ] || fail "no Embree 4 was found; name its library in EMBREE"
c++ -O3 -std=c++17 "$root/benches/peer/embree.cpp" "$library" -Wl,-rpath,"$(dirname "$library")" -o "$place/embree"
echo "Embree: $(basename "$library")" >&2
EMBREE_PEER="$place/embree" exec cargo bench --bench peer --manifest-path "$root/Cargo.toml" -- "$@"
