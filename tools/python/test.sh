#!/usr/bin/env bash
# Builds the Python package as a wheel, installs it into a virtual environment of its own, and runs its tests. Options
# go to pytest. BRICKWALK_PYTHON names the interpreter; else python3 is taken.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)
. "$root/tools/prepare.sh"

MOST_BYTES=$((20 * 1024 * 1024))

prepare
python=${BRICKWALK_PYTHON:-python3}
have "$python" || install_packages python3 python3-venv
"$python" -c 'import ensurepip, venv' 2>/dev/null || install_packages python3-venv

target=${CARGO_TARGET_DIR:-$root/target}
environment=$target/python/venv
if [ ! -x "$environment/bin/python" ]; then
    "$python" -m venv "$environment"
fi
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check \
    'maturin>=1.8,<2' numpy pytest hypothesis trimesh rtree scipy pillow 'moto[server]' trustme

# What the library is made of goes into the wheel.
host=$(rustc -vV | sed -n 's/^host: //p')
package=$root/tools/python/python/brickwalk
"$environment/bin/python" "$root/tools/licences.py" "$host" brickwalk-python >"$package/THIRD-PARTY.txt"
cp "$root/LICENSE-MIT" "$root/LICENSE-APACHE" "$package/"

# Nothing that is built here goes into a debugger.
export CARGO_PROFILE_RELEASE_DEBUG=false
wheels=$target/python/wheels
rm -rf "$wheels"
"$environment/bin/maturin" build --release --locked --features shared --interpreter "$environment/bin/python" \
    --manifest-path "$root/tools/python/Cargo.toml" --target-dir "$target" --out "$wheels"
wheel=$(echo "$wheels"/*.whl)
bytes=$(wc -c <"$wheel")
[ "$bytes" -le "$MOST_BYTES" ] || fail "$wheel has $bytes bytes, more than $MOST_BYTES"
echo "${wheel##*/}: $bytes bytes"

"$environment/bin/python" -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
# The server of a bucket, for the tests of scenes by URL.
cargo build --quiet --release --locked --workspace --manifest-path "$root/Cargo.toml" --target-dir "$target" \
    --bin brickwalk-bucket
export BUCKET=$target/release/brickwalk-bucket
# Away from the sources, so that what is installed is what is tested.
export PYTHONDONTWRITEBYTECODE=1
cd "$target/python"
"$environment/bin/python" -m pytest --quiet -p no:cacheprovider --rootdir "$root/tools/python" \
    -c "$root/tools/python/pyproject.toml" "$@" "$root/tools/python/tests"
