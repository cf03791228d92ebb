#!/bin/sh
# Installs the system packages for Biflag's build, with `test` also those for its tests, with `proof` the emulator of other
# processors, with `dist` those for its packages, with `arm64` those for its packages for arm64,
# with `windows` those for its archive for Windows and the test of it, and prints them first. Does nothing if all are installed.
set -eu
cd "$(dirname "$0")"

packages="gcc g++ pkg-config gcc-avr avr-libc binutils-avr avrdude libsimavr-dev libelf-dev arduino-core-avr python3-venv"
# The tests open the pages that `biflag report` writes in a real browser, and print them.
[ "${1:-}" != test ] || packages="$packages chromium poppler-utils fonts-dejavu-core"
[ "${1:-}" != proof ] || packages="$packages qemu-user"
[ "${1:-}" != dist ] || packages="$packages dpkg-dev debootstrap xz-utils"
case ${1:-} in
    windows)
        packages="$packages gcc-mingw-w64-x86-64 zip unzip wine wine64"
        # As for arm64: `rustup target add x86_64-pc-windows-gnu`.
        [ -d "$(rustc --print target-libdir --target x86_64-pc-windows-gnu 2>/dev/null)" ] ||
            packages="$packages rustc-web cargo-web rust-web-src"
        ;;
    arm64)
        packages="$packages dpkg-dev xz-utils gcc-aarch64-linux-gnu libsimavr-dev:arm64 libelf-dev:arm64 qemu-user-static"
        # rustup's library is used if `rustup target add aarch64-unknown-linux-gnu` has brought it.
        [ -d "$(rustc --print target-libdir --target aarch64-unknown-linux-gnu 2>/dev/null)" ] ||
            packages="$packages rustc-web cargo-web libstd-rust-web-dev:arm64"
        ;;
esac

if ! command -v rustup >/dev/null && ! command -v cargo >/dev/null; then
    echo "Biflag needs Rust: install it from https://rustup.rs, then run this again." >&2
    exit 1
fi
if ! cargo --version >/dev/null 2>&1; then
    echo "Installing Rust's stable toolchain with rustup."
    rustup toolchain install stable --profile minimal --component rustfmt --component clippy
fi
# The firmware is built with rustup's nightly and the sources of `core` if present, else with Debian's compiler.
sh build.sh --check >/dev/null 2>&1 || packages="$packages rustc-web cargo-web rust-web-src"

native=$(dpkg --print-architecture 2>/dev/null || true)
missing=""
for package in $packages; do
    # A package has one line for each of its architectures.
    wanted=$native
    case $package in *:*) wanted=${package##*:} ;; esac
    dpkg-query -W -f='${Architecture} ${db:Status-Status}\n' "$package" 2>/dev/null | grep -qxE "(all|$wanted) installed" ||
        missing="$missing $package"
done
[ -n "$missing" ] || exit 0

if [ "$(id -u)" = 0 ]; then
    as_root=""
elif command -v sudo >/dev/null && { [ -t 0 ] || sudo -n true 2>/dev/null; }; then
    as_root="sudo"
else
    echo "Not allowed to install packages: run \`sudo apt install$missing\`, then run this again." >&2
    exit 1
fi
echo "Installing with apt:$missing"
case $missing in
    *:arm64*) $as_root dpkg --add-architecture arm64 ;;
esac
$as_root apt-get update -qq
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
