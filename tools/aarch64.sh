#!/usr/bin/env bash
# Builds for aarch64 and runs what NEON has tests of there, emulated by qemu: vectors, nodes, packets of rays. On Debian
# and its relatives it installs the cross compiler and qemu. Options go to `cargo test`.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/tools/prepare.sh"

prepare
missing=()
have aarch64-linux-gnu-g++ || missing+=(g++-aarch64-linux-gnu)
have qemu-aarch64 || missing+=(qemu-user)
[ "${#missing[@]}" -eq 0 ] || install_packages "${missing[@]}"
if have rustup; then
    rustup target add aarch64-unknown-linux-gnu
fi

export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu"
exec cargo test --release --lib --target aarch64-unknown-linux-gnu --manifest-path "$root/Cargo.toml" "$@" \
    -- kernels::simd kernels::trace::packet
