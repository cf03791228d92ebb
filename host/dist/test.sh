#!/bin/sh
# Installs the packages in target/dist into a plain Debian 12 without compilers, and works with them there: host/dist/check.sh.
# Needs root, debootstrap and the network. The plain Debian is kept in target/dist/debian-12 for the next time.
set -eu
cd "$(dirname "$0")/../.."
dist=$PWD/target/dist
base=$dist/debian-12
root=$dist/root
bootloaders=/usr/share/arduino/hardware/arduino/avr/bootloaders

if [ "$(id -u)" != 0 ]; then
    echo "A root of Debian can only be made as root: run \`sudo make dist-test\`." >&2
    exit 1
fi

if [ ! -d "$base" ]; then
    rm -rf "$base.partial"
    debootstrap --variant=minbase bookworm "$base.partial" > "$dist/debootstrap.log"
    # What both tests need that is no part of Biflag.
    cp /etc/resolv.conf "$base.partial/etc/resolv.conf"
    chroot "$base.partial" apt-get install -y -qq --no-install-recommends avrdude >> "$dist/debootstrap.log" 2>&1
    mv "$base.partial" "$base"
fi

# Runs a command in a fresh root, with the packages in /packages.
in_debian() {
    rm -rf "$root"
    cp -a "$base" "$root"
    mkdir -p "$root/packages" "$root$bootloaders"
    cp "$dist"/biflag_*"_$(dpkg --print-architecture).deb" "$dist"/biflag-*"-linux-$(uname -m).tar.gz" host/dist/check.sh "$root/packages"
    # Of Debian's arduino-core-avr, which would bring avr-gcc.
    cp -R $bootloaders/optiboot $bootloaders/atmega "$root$bootloaders"
    unshare --mount --pid --fork sh -euc '
        mount -t proc proc "$1/proc"
        mount -t devpts -o newinstance,ptmxmode=0666 devpts "$1/dev/pts"
        rm -f "$1/dev/ptmx"
        ln -s pts/ptmx "$1/dev/ptmx"
        exec chroot "$1" sh -euc "$2"' sh "$root" "$1"
}

echo "== The Debian package"
in_debian '
    apt-get install -y -qq --no-install-recommends /packages/*.deb > /dev/null 2>&1
    test -f /usr/lib/udev/rules.d/60-biflag.rules
    test -f /usr/share/bash-completion/completions/biflag
    test -f /usr/share/man/man1/biflag-record.1.gz
    test -f /usr/share/doc/biflag/copyright
    sh /packages/check.sh
    apt-get remove -y -qq biflag > /dev/null 2>&1
    ! command -v biflag'

echo "== The archive, by a user who is not root"
in_debian '
    useradd --create-home user
    su user -c "cd && mkdir .local && tar -xzf /packages/*.tar.gz && cp -r biflag-*/bin biflag-*/share .local"
    su user -c "PATH=/home/user/.local/bin:/usr/bin:/bin sh /packages/check.sh"'

rm -rf "$root"
echo "Both work on a plain Debian 12."
