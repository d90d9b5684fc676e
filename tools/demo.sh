#!/usr/bin/env bash
# Generates a city larger than the demo's cache, converts it, walks through it and writes a report.
# Options are those of `brickwalk demo` (see `tools/demo.sh --help`).
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

prepare
# Run where the caller stands, so that relative paths in the options mean what they say.
exec cargo run --release --manifest-path "$root/Cargo.toml" -- demo "$@"
