#!/bin/sh
# Packs what was built, into target/dist: a Debian package, and an archive that works without root.
#
#   host/dist/package.sh          for this computer, after `make build`
#   host/dist/package.sh arm64    for a Raspberry Pi, after host/dist/arm64.sh
set -eu
cd "$(dirname "$0")/../.."
out=target/dist
name=biflag
# The one that runs here; it is of the same commit.
biflag=target/release/biflag
arch=${1:-$(dpkg --print-architecture)}
case $arch in
    arm64) built=target/aarch64-unknown-linux-gnu/release machine=aarch64 tools=aarch64-linux-gnu- ;;
    *) built=target/release machine=$(uname -m) tools= ;;
esac

# `biflag 0.1.0 (c0ffee12)`
version=$($biflag --version | cut -d ' ' -f 2)
commit=$($biflag --version | sed 's/.*(\(.*\))/\1/')
case $commit in
    *-dirty) echo "The working tree has changes: this package is for tests." >&2 ;;
esac
date=$(git log -1 --format=%cd --date=format:%Y%m%d%H%M%S)
full=$version+git$date.$(echo "$commit" | tr - .)

rm -rf "$out/stage"
# Where Debian's tools look for a package.
package=$out/stage/debian/$name
stage=$package/usr
doc=$stage/share/doc/$name
mkdir -p "$stage/bin" "$doc/plans" "$stage/share/man/man1"

for program in biflag vnano; do
    "${tools}strip" -o "$stage/bin/$program" "$built/$program"
    chmod 755 "$stage/bin/$program"
done
# Completions and manual pages are those of this very program.
completions() {
    mkdir -p "$stage/share/$2"
    $biflag completions "$1" > "$stage/share/$2/$3"
}
completions bash bash-completion/completions biflag
completions zsh zsh/vendor-completions _biflag
completions fish fish/vendor_completions.d biflag.fish
$biflag man "$stage/share/man/man1" > /dev/null
gzip -9n "$stage"/share/man/man1/*
cp CHANGELOG.md LICENSE-MIT LICENSE-APACHE sim/virtual-nano/LICENSE-GPL host/dist/copyright "$doc"
cp host/plans/*.toml "$doc/plans"
cp -RL host/book/src "$doc/book"
cp -R host/layouts "$doc"
python3 host/dist/libraries.py host virtual-nano firmware > "$doc/libraries"

# The archive: unpack it anywhere, or into ~/.local.
archive=$name-$version-linux-$machine
cp -R "$stage" "$out/stage/$archive"
mkdir -p "$out/stage/$archive/share/$name"
cp host/dist/60-biflag.rules "$out/stage/$archive/share/$name"
cp host/dist/INSTALL.md "$out/stage/$archive"
rm -f "$out/$archive.tar.gz" "$out/$name"_*"_$arch.deb"
tar -C "$out/stage" --owner=0 --group=0 --sort=name -czf "$out/$archive.tar.gz" "$archive"

# The Debian package.
gzip -9n "$doc/libraries"
mkdir -p "$stage/lib/udev/rules.d" "$package/DEBIAN"
cp host/dist/60-biflag.rules "$stage/lib/udev/rules.d"
# dpkg-shlibdeps wants a source package's control file.
printf 'Source: %s\n\nPackage: %s\nArchitecture: any\n' $name $name > "$out/stage/debian/control"
programs="debian/$name/usr/bin/biflag debian/$name/usr/bin/vnano"
libraries=$(cd "$out/stage" && DEB_HOST_ARCH=$arch dpkg-shlibdeps -O $programs | sed 's/shlibs:Depends=//')
cat > "$package/DEBIAN/control" <<END
Package: $name
Version: $full
Architecture: $arch
Maintainer: Biflag contributors <biflag@localhost>
Installed-Size: $(du -sk "$stage" | cut -f 1)
Depends: $libraries, avrdude
Suggests: ffmpeg
Section: science
Priority: optional
Description: records, simulates and compares trials of a two-flagella robot
 Biflag flashes the firmware of a robot that swims with two flagella, records
 trials on it, simulates them in a model of the robot in glycerin, and compares
 both. vnano is the robot's board, emulated, with which all of this runs
 without hardware.
END
cat > "$package/DEBIAN/postinst" <<'END'
#!/bin/sh
set -e
# Boards that are plugged in get the rule too.
if [ "$1" = configure ] && command -v udevadm > /dev/null; then
    udevadm control --reload || true
    udevadm trigger --subsystem-match=tty --action=change || true
fi
END
chmod 755 "$package/DEBIAN/postinst"
(cd "$package" && find usr -type f | sort | xargs md5sum > DEBIAN/md5sums)
dpkg-deb --root-owner-group -Zxz --build "$package" "$out/${name}_${full}_$arch.deb" > /dev/null

echo "stripped: biflag $(stat -c %s "$stage/bin/biflag") bytes, vnano $(stat -c %s "$stage/bin/vnano") bytes"
if [ "$built" = target/release ]; then
    start=$(date +%s%N)
    for _ in $(seq 100); do
        "$stage/bin/biflag" --version > /dev/null
    done
    end=$(date +%s%N)
    echo "biflag --version: $(((end - start) / 100000)) us, mean of 100 starts"
fi
rm -r "$out/stage"
ls -l "$out"/$name[-_]*
