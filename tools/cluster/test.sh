#!/usr/bin/env bash
# Installs the package beside the wheel that tools/python/test.sh has built, and runs its tests. Options go to pytest.
# BRICKWALK names the program; else the one that this checkout has built last is taken, or built. It must be of the
# wheel's commit, which is seen to before anything is rendered.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)
. "$root/tools/prepare.sh"

target=${CARGO_TARGET_DIR:-$root/target}
environment=$target/python/venv
[ -x "$environment/bin/python" ] || fail "$environment is missing; run tools/python/test.sh first"
if [ -z "${BRICKWALK:-}" ]; then
    prepare
    # The tests of the workspace have built it.
    [ -x "$target/release/brickwalk" ] ||
        cargo build --quiet --release --workspace --manifest-path "$root/Cargo.toml" --bin brickwalk
    BRICKWALK=$target/release/brickwalk
fi
BUCKET=${BUCKET:-$target/release/brickwalk-bucket}
if [ ! -x "$BUCKET" ]; then
    prepare
    cargo build --quiet --release --workspace --manifest-path "$root/Cargo.toml" --bin brickwalk-bucket
fi
export BRICKWALK BUCKET PYTHONDONTWRITEBYTECODE=1
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check \
    'distributed>=2024.1' 'openjd-cli>=0.8' pytest 'setuptools>=69' wheel
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation \
    --force-reinstall "$root/tools/cluster"
rm -rf "$root/tools/cluster/build" "$root/tools/cluster/brickwalk_cluster.egg-info"
# Away from the sources, so that what is installed is what is tested.
cd "$target/python"
"$environment/bin/python" -m pytest --quiet -p no:cacheprovider --rootdir "$root/tools/cluster" \
    -c "$root/tools/cluster/pyproject.toml" "$@" "$root/tools/cluster/tests"
