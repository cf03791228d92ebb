#!/bin/sh
# Installs what Biflag's build needs from the system, and with `test` what its tests need besides, and says so first. Does
# nothing where all is there.
set -eu
cd "$(dirname "$0")"

packages="gcc g++ pkg-config gcc-avr avr-libc binutils-avr avrdude libsimavr-dev libelf-dev arduino-core-avr python3-venv"
# The tests open the pages that `biflag report` writes in a real browser, and print them.
[ "${1:-}" != test ] || packages="$packages chromium poppler-utils fonts-dejavu-core"

if ! command -v rustup >/dev/null && ! command -v cargo >/dev/null; then
    echo "Biflag needs Rust: install it from https://rustup.rs, then run this again." >&2
    exit 1
fi
if ! cargo --version >/dev/null 2>&1; then
    echo "Installing Rust's stable toolchain with rustup."
    rustup toolchain install stable --profile minimal --component rustfmt --component clippy
fi
# The firmware's build takes rustup's nightly with the sources of `core` where it is there, else Debian's compiler.
sh build.sh --check >/dev/null 2>&1 || packages="$packages rustc-web cargo-web rust-web-src"

missing=""
for package in $packages; do
    dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing="$missing $package"
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
$as_root apt-get update -qq
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
