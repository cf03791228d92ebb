#!/bin/sh
# Builds biflag and vnano for arm64, and runs both under QEMU: a trial on the emulated board, and one in the model. After
# `make build`, whose firmware image biflag contains.
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

scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT
# biflag starts vnano, which the kernel cannot run: it finds this one on the PATH.
printf '#!/bin/sh\nexec qemu-aarch64-static "%s/vnano" "$@"\n' "$built" > "$scratch/vnano"
chmod 755 "$scratch/vnano"
mkdir "$scratch/bin"
cp "$built/biflag" "$scratch/bin"
cat > "$scratch/plan.toml" <<END
[trial]
calibrate = 1
preroll = 2
run = 6
decay = 2
[speeds]
pairs = [[50, 10]]
END
emulated() {
    echo "qemu-aarch64: biflag $*"
    (cd "$scratch" && PATH="$scratch:$PATH" qemu-aarch64-static bin/biflag "$@") || [ $? = 3 ]
}
emulated --version
emulated record plan.toml --virtual --out recorded
emulated simulate --speeds=50,10 --duration 20 --out modelled
emulated report modelled
