#!/usr/bin/env bash
# Runs all tests, and says at the end which were skipped and why. Options go to `cargo test`. BRICKWALK_SCENES may name
# a folder of scene files that some tests read. Skipped tests are lines of the file that BRICKWALK_SKIPPED names.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

prepare tests
if [ -z "${BRICKWALK_SKIPPED:-}" ]; then
    BRICKWALK_SKIPPED=$(mktemp)
    trap 'rm -f "$BRICKWALK_SKIPPED"' EXIT
fi
export BRICKWALK_SKIPPED
# Tests wait for programs that they start, so that a thread more than there are cores keeps these busy.
export RUST_TEST_THREADS=${RUST_TEST_THREADS:-$(($(nproc 2>/dev/null || echo 1) + 1))}
status=0
cargo test --release --workspace --manifest-path "$root/Cargo.toml" "$@" || status=$?
tell_skipped || true
exit "$status"
