#!/bin/sh
# Builds biflag and vnano for arm64, runs a trial in the model under QEMU, and checks that results have the same bits as on other
# processors. After `make build`, whose firmware image biflag contains. No recording: QEMU 7.2 lacks the ioctl TCGETS2, with
# which serial ports and pseudo-terminals are set up.
set -eu
cd "$(dirname "$0")/../.."
target=aarch64-unknown-linux-gnu
built=$PWD/target/$target/release

# rustup's library for the target if it is there, else Debian's.
if [ -d "$(rustc --print target-libdir --target $target 2>/dev/null)" ]; then
    cargo=cargo
else
    cargo=/usr/bin/cargo
    # Otherwise cargo would take the first rustc in the path, which may be rustup's.
    export RUSTC=/usr/bin/rustc
fi
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
$cargo build --release --locked -p host -p virtual-nano --bins --target $target

CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER=qemu-aarch64-static \
    $cargo test --release --locked -p sim --lib --target $target same_bits

scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT
mkdir "$scratch/bin"
cp "$built/biflag" "$scratch/bin"
emulated() {
    echo "qemu-aarch64: biflag $*"
    (cd "$scratch" && qemu-aarch64-static bin/biflag "$@") || [ $? = 3 ]
}
emulated --version
emulated simulate --speeds=50,10 --duration 20 --out modelled
emulated report modelled
