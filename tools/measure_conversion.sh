#!/usr/bin/env bash
# Measures the conversion of generated cities from glTF: rates, phases, peak memory; prints a Markdown table. Scenes and
# finished rows are kept in the folder, so that an interrupted measurement continues. tools/measure_conversion.sh FOLDER
# [TRIANGLES [LARGE]]        defaults: 12M, 20M TRIANGLES as .glb is converted in memory, with --fast, and with --memory
# 15 bytes a triangle, a tenth of the peak in memory; LARGE as .gltf with --memory 1G. Needs GNU time at /usr/bin/time.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

[ $# -ge 1 ] || fail "usage: $0 FOLDER [TRIANGLES [LARGE]]"
[ -x /usr/bin/time ] || fail "/usr/bin/time is missing; install the package time"
folder=$1 triangles=${2:-12M} large=${3:-20M}
prepare
cargo build --release --manifest-path "$root/Cargo.toml" >&2
brickwalk=$root/target/release/brickwalk
mkdir -p "$folder"
cd "$folder"

case $triangles in
    *M) tenth=$((${triangles%M} * 15))M ;;
    *) fail "$triangles: give whole millions, as in 12M" ;;
esac

# scene FILE COUNT: generates a city.
scene() {
    [ -e "$1" ] || "$brickwalk" scene city --triangles "$2" -o "$1" >&2
}

# row FILE OPTIONS: converts, and prints a row of the table, which is kept.
row() {
    local file=$1 options=$2
    local key="row-$file-${options// /}"
    if [ ! -e "$key" ]; then
        local read_s load
        # Once without counting, so that every row finds the file where the system can hold it.
        cat "$file" "${file%.*}.bin" >/dev/null 2>&1 || true
        read_s=$( { /usr/bin/time -f %e cat "$file" >/dev/null; } 2>&1)
        load=$(cut -d ' ' -f 1 /proc/loadavg)
        # shellcheck disable=SC2086
        /usr/bin/time -f '%e %U %S %M' -o time.txt "$brickwalk" convert "$file" -o out.bricks $options >said.txt
        "$brickwalk" verify out.bricks >&2
        local wall user system peak count
        read -r wall user system peak <time.txt
        count=$("$brickwalk" info out.bricks --json | sed -n 's/.*"triangles_stored": \([0-9]*\).*/\1/p')
        awk -v n="$count" -v w="$wall" -v u="$user" -v s="$system" -v p="$peak" -v r="$read_s" -v l="$load" \
            -v name="$file" -v options="${options:-in memory}" -v phases="$(sed -n '2s/^[^:]*: //p' said.txt)" 'BEGIN {
                printf "| %s %s | %.2fM | %.1f | %.2f | %.1f | %.2f | %.0f | %.1f | %s | %s |\n", name, options,
                    n / 1e6, w, n / w / 1e6, u + s, n / (u + s) / 1e6, p / 1024, r, l, phases }' >"$key.tmp"
        mv "$key.tmp" "$key"
        rm -f out.bricks
    fi
    cat "$key"
}

scene "city-$triangles.glb" "$triangles"
scene "city-$large.gltf" "$large"
echo "# Conversion of cities of $triangles and $large triangles from glTF"
echo
# The last change of what is measured.
commit=$(git -C "$root" log -1 --format=%h --abbrev=12 -- tools/convert bricks)
echo "Converter of commit $commit, $(date +%F), $(nproc) cores, no adapter needed."
echo
echo "| input, options | triangles | wall s | M triangles/s | processor s | M triangles/processor s | peak MiB" \
    "| reading alone s | load before | phases |"
echo "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
row "city-$triangles.glb" ""
row "city-$triangles.glb" "--fast"
row "city-$triangles.glb" "--memory $tenth"
row "city-$large.gltf" "--memory 1G"
