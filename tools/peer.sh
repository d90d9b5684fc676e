#!/usr/bin/env bash
# Measures the processor's kernels against Embree and the crate obvhs, the same rays through the same triangles, in
# turns, and prints tables. Words are sizes of generated cities (default: 1M 5M). --plot FILE.svg draws the rates over
# them. No other program should be busy meanwhile.
#
#   tools/peer.sh --plot rates.svg 100K 300K 1M 3M 5M 12M
#
# Embree 4 is the library that EMBREE names, else the system's, else that of the Python package embreex, which is
# installed under target/peer. PEERS names further programs to measure, separated by colons: each does what
# benches/peer/protocol.h says, and may include it.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

# The benchmark runs in the root of the project: what is named from here gets its whole path.
words=()
while [ $# -gt 0 ]; do
    if [ "$1" = --plot ]; then
        [ $# -gt 1 ] || fail "--plot wants a file"
        words+=(--plot "$(realpath -m -- "$2")")
        shift
    else
        words+=("$1")
    fi
    shift
done
peers=
IFS=: read -ra others <<<"${PEERS:-}"
for program in ${others[@]+"${others[@]}"}; do
    [ -f "$program" ] && [ -x "$program" ] || fail "$program, which PEERS names, is no program; build it first"
    peers+=:$(realpath -- "$program")
done
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
c++ -O3 -std=c++17 -pthread "$root/benches/peer/embree.cpp" "$library" -Wl,-rpath,"$(dirname "$library")" \
    -o "$place/embree"
echo "Embree: $(basename "$library")" >&2
export PEERS="$place/embree$peers"
exec cargo bench --bench peer --manifest-path "$root/Cargo.toml" -- ${words[@]+"${words[@]}"}
