#!/usr/bin/env bash
# Runs all tests. Options go to `cargo test`. BRICKWALK_SCENES may name a folder of scene files that some tests read.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

prepare vulkan
exec cargo test --release --workspace --manifest-path "$root/Cargo.toml" "$@"
