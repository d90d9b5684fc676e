# Sourced by the scripts beside it: makes sure that cargo, a C++ compiler and linker, and what tests want are
# there. On Debian and its relatives it installs what is missing with apt-get; elsewhere it says what to install.
# shellcheck shell=bash

fail() {
    echo "${0##*/}: $*" >&2
    exit 1
}

have() {
    command -v "$1" >/dev/null 2>&1
}

# A Vulkan loader that programs find.
have_vulkan_loader() {
    local ldconfig folder
    for ldconfig in ldconfig /sbin/ldconfig /usr/sbin/ldconfig; do
        # Read whole: with pipefail, a grep that stops early would fail the pipe.
        if have "$ldconfig" && "$ldconfig" -p 2>/dev/null | grep -F 'libvulkan.so.1' >/dev/null; then
            return 0
        fi
    done
    local -a folders
    IFS=: read -ra folders <<<"${LD_LIBRARY_PATH:-}"
    for folder in ${folders[@]+"${folders[@]}"} /usr/lib /usr/lib64 /usr/local/lib; do
        if [ -e "$folder/libvulkan.so.1" ]; then
            return 0
        fi
    done
    return 1
}

# The manifest of at least one Vulkan driver, which is how the loader finds drivers.
have_vulkan_driver() {
    if [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]; then
        return 0
    fi
    local folder
    for folder in /usr/share /usr/local/share /etc "${XDG_DATA_HOME:-${HOME:-/root}/.local/share}"; do
        if compgen -G "$folder/vulkan/icd.d/*.json" >/dev/null; then
            return 0
        fi
    done
    return 1
}

# A python3 that has NumPy, in any folder of PATH.
have_numpy() {
    local folder
    local -a folders
    IFS=: read -ra folders <<<"$PATH"
    for folder in "${folders[@]}"; do
        if [ -x "$folder/python3" ] && "$folder/python3" -c 'import numpy' 2>/dev/null; then
            return 0
        fi
    done
    return 1
}

install_packages() {
    if ! have apt-get; then
        fail "missing: $*. Install a C++ compiler, the Vulkan loader and a Vulkan driver (Fedora: gcc-c++" \
            "vulkan-loader mesa-vulkan-drivers; Arch: gcc vulkan-icd-loader vulkan-swrast), then run this again"
    fi
    local -a root=()
    if [ "$(id -u)" -ne 0 ]; then
        have sudo || fail "missing: $*. Run as root: apt-get install $*"
        root=(sudo)
    fi
    echo "${0##*/}: installing $*" >&2
    ${root[@]+"${root[@]}"} apt-get update -qq >&2 ||
        fail "apt-get update failed; check the network, then run this again"
    ${root[@]+"${root[@]}"} env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends "$@" >&2 ||
        fail "apt-get install $* failed; install them, then run this again"
}

# Says which tests were skipped, by the lines of the file BRICKWALK_SKIPPED; fails if there are any.
tell_skipped() {
    local count=0
    if [ -s "$BRICKWALK_SKIPPED" ]; then
        sort -u "$BRICKWALK_SKIPPED"
        count=$(sort -u "$BRICKWALK_SKIPPED" | wc -l)
    fi
    echo "$count tests skipped"
    [ "$count" -eq 0 ]
}

# The libraries that a window loads on X11.
have_window_libraries() {
    local ldconfig name
    for ldconfig in ldconfig /sbin/ldconfig /usr/sbin/ldconfig; do
        have "$ldconfig" || continue
        for name in libxkbcommon-x11.so.0 libXcursor.so.1 libXi.so.6 libXrandr.so.2; do
            "$ldconfig" -p 2>/dev/null | grep -F "$name" >/dev/null || return 1
        done
        return 0
    done
    return 1
}

# Whether this is Debian, where a browser is a package like others.
is_debian() {
    grep -qx 'ID=debian' /etc/os-release 2>/dev/null
}

# With the argument `tests`, what tests want: a Vulkan driver, and where apt-get brings them NumPy and a display without
# a screen and a browser.
prepare() {
    if ! have cargo && [ -r "${HOME:-/root}/.cargo/env" ]; then
        # shellcheck source=/dev/null
        . "${HOME:-/root}/.cargo/env"
    fi
    have cargo || fail "cargo is missing; install Rust from https://rustup.rs, then run this again"

    local -a missing=()
    if ! have c++ || ! have cc; then
        missing+=(g++)
    fi
    # The graphics systems of other platforms need no package.
    if [ "${1:-}" = tests ] && [ "$(uname -s)" = Linux ]; then
        have_vulkan_loader || missing+=(libvulkan1)
        have_vulkan_driver || missing+=(mesa-vulkan-drivers)
        if have apt-get; then
            have_numpy || missing+=(python3-numpy)
            have Xvfb || missing+=(xvfb)
            have xdotool || missing+=(xdotool)
            ! is_debian || have chromium || missing+=(chromium)
            have_window_libraries || missing+=(libxkbcommon-x11-0 libxcursor1 libxi6 libxrandr2)
        fi
    fi
    if [ "${#missing[@]}" -gt 0 ]; then
        install_packages "${missing[@]}"
    fi
}
