#!/bin/sh
# Runs cargo for Windows: `windows-cargo.sh test -p system`. With rustup's library for it if it is there, else with Debian's
# sources of the library.
set -eu
target=x86_64-pc-windows-gnu
command=$1
shift
if [ -d "$(rustc --print target-libdir --target $target 2>/dev/null)" ]; then
    exec cargo "$command" --release --locked --target $target "$@"
fi
# Otherwise cargo would take the first rustc in the path, which may be rustup's.
export RUSTC=/usr/bin/rustc
# Sources of the library are for unstable compilers only. Unwinding lets a sweep go on after a point that fails.
export RUSTC_BOOTSTRAP=1
exec /usr/bin/cargo "$command" -Z build-std=std,panic_unwind --release --locked --target $target "$@"
