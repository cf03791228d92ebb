#!/bin/sh
# Lays the package into the folder $1 as pip installs it, with the library that `make python` has built.
set -eu
cd "$(dirname "$0")"
library=../../target/release/lib_biflag.so
[ -f "$library" ] || { echo "$library is missing: build it first with \`make python\`" >&2; exit 1; }
mkdir -p "$1/biflag"
cp python/biflag/*.py* "$1/biflag"
cp "$library" "$1/biflag/_biflag.abi3.so"
