#!/usr/bin/env bash
# Makes a release of the commit that is checked out, in target/dist:
#
#   brickwalk-VERSION-x86_64-linux.tar.gz   the program, README, licences, man pages, completions
#   brickwalk-VERSION-source.tar.gz         the sources
#   SHA256SUMS                              of both
#
# The program runs on any x86-64 Linux with glibc 2.28 or newer (Debian 10, RHEL 8, Ubuntu 18.10) and needs nothing
# else. That is checked here. Needs: cargo, git, readelf and strip (binutils), and python3 with venv and pip, which
# fetches zig and cargo-zigbuild: a compiler and linker that know the symbols of every glibc.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
. tools/prepare.sh

glibc=2.28
target=x86_64-unknown-linux-gnu
zig=(ziglang==0.17.1 cargo-zigbuild==0.24.0)

have cargo || fail "cargo is missing; install Rust from https://rustup.rs, then run this again"
for tool in git readelf strip python3 tar sha256sum; do
    have "$tool" || fail "$tool is missing (Debian: apt-get install git binutils python3 python3-venv tar coreutils)"
done
[ "$(uname -sm)" = "Linux x86_64" ] || fail "it runs on x86-64 Linux; this is $(uname -sm)"
[ -z "$(git status --porcelain)" ] || fail "there are changes that are not committed; a release is of a commit"

# Zig's compiler, in an environment of its own.
tools=$root/target/release-tools
if ! "$tools/bin/pip" freeze 2>/dev/null | grep -qxF "${zig[0]}"; then
    python3 -m venv "$tools" || fail "python3 -m venv failed (Debian: apt-get install python3-venv)"
    "$tools/bin/pip" install --quiet --disable-pip-version-check "${zig[@]}" ||
        fail "pip install ${zig[*]} failed; check the network, then run this again"
fi
# Not the folder of what this machine's own linker makes.
export CARGO_TARGET_DIR=$root/target/zig
PATH=$tools/bin:$PATH cargo zigbuild --release --locked --bin brickwalk --target "$target.$glibc"

version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
name=brickwalk-$version
out=$root/target/dist
rm -rf "$out"
place=$out/$name-x86_64-linux
mkdir -p "$place"
program=$place/brickwalk
cp "$CARGO_TARGET_DIR/$target/release/brickwalk" "$program"
strip "$program"

# The libraries that it loads are glibc's own, and no symbol is newer.
readelf -d "$program" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | while read -r library; do
    case $library in
        libc.so.6 | libm.so.6 | libdl.so.2 | libpthread.so.0 | librt.so.1 | libutil.so.1 | ld-linux-x86-64.so.2) ;;
        *) fail "the program needs $library" ;;
    esac
done
newest=$(readelf -V "$program" | grep -o 'GLIBC_[0-9.]*' | sed 's/GLIBC_//' | sort -uV | tail -1)
[ "$(printf '%s\n' "$newest" "$glibc" | sort -V | tail -1)" = "$glibc" ] || fail "the program needs glibc $newest"
"$program" --version

cp README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$place/"
python3 tools/licences.py "$target" >"$place/THIRD-PARTY.txt"
mkdir "$place/completions"
for shell in bash zsh fish; do
    "$program" completions "$shell" >"$place/completions/brickwalk.$shell"
done
"$program" man "$place/man"

# Equal commits make equal archives.
time=$(git log -1 --format=%ct)
tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$time" -C "$out" -c "$name-x86_64-linux" |
    gzip -n9 >"$out/$name-x86_64-linux.tar.gz"
git archive --prefix="$name/" HEAD | gzip -n9 >"$out/$name-source.tar.gz"
(cd "$out" && sha256sum ./*.tar.gz | tee SHA256SUMS)
echo "$out: glibc $newest or newer"
