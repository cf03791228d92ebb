#!/bin/sh
# Builds the Nano's image and prints its path as the last line on stdout; everything else goes to stderr.
#
#   firmware/build.sh            build; prints <root>/target/firmware.elf
#   firmware/build.sh --check    print the toolchain only
#   firmware/build.sh --sources  print the hash of the sources only, which the image contains
#
# The image needs a compiler for AVR with the sources of its own `core`: rustup's nightly with rust-src, or
# Debian's rustc-web with rust-web-src. The rest of the workspace needs neither.
set -eu

install='install an AVR toolchain: `rustup toolchain install nightly --component rust-src` (or Debian'\''s `apt install rustc-web cargo-web rust-web-src`), and `apt install gcc-avr avr-libc binutils-avr`'

# A cargo that runs this script (a test, a build) leaves its settings in the environment, and a user may have set flags for
# the host. Neither may reach the build for the AVR; only the location of the registry is kept.
for name in $(env | sed -n 's/^\(\(CARGO\|RUST\)[A-Za-z0-9_]*\)=.*/\1/p'); do
    case $name in
        CARGO_HOME | RUSTUP_HOME | CARGO_NET_* | CARGO_HTTP_* | CARGO_REGISTR* | CARGO_SOURCE_*) ;;
        *) unset "$name" ;;
    esac
done
unset LD_LIBRARY_PATH

root=$(cd "$(dirname "$0")/.." && pwd)
# By content: a checkout changes times, and a copy has its own.
of_sources() {
    (cd "$root" && find firmware protocol Cargo.toml Cargo.lock -type f -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c1-64)
}
sources=$(of_sources)
if [ ${#sources} -ne 64 ]; then
    echo "The sources of the firmware cannot be hashed; install coreutils and findutils." >&2
    exit 1
fi
if [ "${1-}" = --sources ]; then
    echo "$sources"
    exit 0
fi

# True if the compiler $1 can build for AVR: it has the backend and the sources of its own core.
can_build() {
    sysroot=$("$@" --print sysroot 2>/dev/null) &&
        [ -f "$sysroot/lib/rustlib/src/rust/library/core/src/lib.rs" ] &&
        "$@" --print target-list 2>/dev/null | grep -qx avr-none
}

# rustup must not download a nightly that is absent.
export RUSTUP_AUTO_INSTALL=0
if command -v rustup >/dev/null 2>&1 && can_build rustup run nightly rustc; then
    cargo='rustup run nightly cargo'
    found="rustup nightly with rust-src: $(rustup run nightly rustc --version)"
elif [ -x /usr/bin/cargo ] && can_build /usr/bin/rustc; then
    cargo=/usr/bin/cargo
    # Otherwise cargo would take the first rustc in the path, which may be rustup's.
    export RUSTC=/usr/bin/rustc
    # Lets a stable cargo read `build-std`.
    export RUSTC_BOOTSTRAP=1
    found="Debian's, with its sources: $(/usr/bin/rustc --version)"
else
    echo "No Rust compiler here can build for AVR; $install." >&2
    exit 1
fi
if ! command -v avr-gcc >/dev/null 2>&1; then
    echo "There is no avr-gcc to link the image; $install." >&2
    exit 1
fi

if [ "${1-}" = --check ]; then
    echo "$found"
    exit 0
fi

cd "$root/firmware"
echo "Building the firmware with $found" >&2
$cargo build --locked --profile avr --bin firmware --target-dir "$root/target" >&2
if [ "$(of_sources)" != "$sources" ]; then
    echo "The sources of the firmware changed while it was built; build it again." >&2
    exit 1
fi

# Tests build in parallel and load the image meanwhile: replace it atomically, and only if it has changed.
built=$root/target/avr-none/avr/firmware.elf
image=$root/target/firmware.elf
# Without symbols: the image that goes into `biflag`.
stripped=$root/target/firmware.stripped.elf
printf 'biflag-sources:%s' "$sources" > "$image.$$.sources"
avr-objcopy --add-section .biflag.sources="$image.$$.sources" "$built" "$image.$$.tmp"
if ! cmp -s "$image.$$.tmp" "$image" || [ ! -f "$stripped" ]; then
    avr-strip -o "$stripped.$$.tmp" "$image.$$.tmp"
    mv "$stripped.$$.tmp" "$stripped"
    mv "$image.$$.tmp" "$image"
fi
rm -f "$image.$$.tmp" "$image.$$.sources"
echo "$image"
