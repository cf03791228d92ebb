#!/bin/sh
# Builds biflag for Windows, and packs it into target/dist. After `make build`, whose firmware image biflag contains.
set -eu
cd "$(dirname "$0")/../.."
target=x86_64-pc-windows-gnu
out=target/dist
version=$(target/release/biflag --version | cut -d ' ' -f 2)
name=biflag-$version-windows-x86_64

begun=$(date +%s)
sh host/dist/windows-cargo.sh build -p host --bins
ended=$(date +%s)

rm -rf "$out/stage" "$out/$name.zip"
stage=$out/stage/$name
mkdir -p "$stage"
x86_64-w64-mingw32-strip -o "$stage/biflag.exe" target/$target/release/biflag.exe
cp CHANGELOG.md LICENSE-MIT LICENSE-APACHE host/dist/start.html "$stage"
# Without the emulated board, which is not in it.
sed '/^Files: bin\/vnano/,/^$/d; /^License: GPL/,$d; s,bin/biflag,biflag.exe,; s,"libraries","libraries.txt",' host/dist/copyright > "$stage/copyright.txt"
python3 host/dist/libraries.py --target $target host firmware > "$stage/libraries.txt"
cp -r host/plans host/layouts "$stage"
cp -RL host/book/src "$stage/book"
(cd "$out/stage" && zip -qrX "../$name.zip" "$name")
rm -r "$out/stage"
echo "built in $((ended - begun)) s"
ls -l "$out/$name.zip"
