#!/bin/sh
# Prints where the image's flash and RAM go, in bytes: each part (crate and module), then each symbol, largest first.
#
#   firmware/size.sh [IMAGE]    default: <root>/target/firmware.elf, which `firmware/build.sh` builds
set -eu

image=${1:-$(dirname "$0")/../target/firmware.elf}
[ -f "$image" ] || { echo "There is no $image: run firmware/build.sh first." >&2; exit 1; }

# Lines of address, size, kind and name: t, T, W are code, d and D are in flash and in RAM, b and B in RAM.
symbols() {
    avr-nm --print-size --radix=d "$image" | c++filt | sed 's/\[[0-9a-f]\{12,16\}\]//g' | awk 'NF > 3 {
        flash = $3 ~ /[tTWdDrR]/ ? $2 : 0
        ram = $3 ~ /[bBdD]/ ? $2 : 0
        name = $0
        sub(/^[^ ]+ [^ ]+ [^ ]+ /, "", name)
        printf "%6d %6d  %s\n", flash, ram, name
    }' | sort -k1,1nr -k2,2nr
}

echo " flash    RAM"
avr-size "$image" | awk 'NR == 2 { printf "%6d %6d  all\n\n", $1 + $2, $2 + $3 }'
symbols | awk '{
    # `crate::module` of the function or of the type whose method it is.
    part = $3 ~ /::/ ? $3 : "assembler"
    sub(/^<+/, "", part)
    sub(/<.*/, "", part)
    sub(/>.*/, "", part)
    pieces = split(part, path, "::")
    part = path[1] (pieces > 2 ? "::" path[2] : "")
    flash[part] += $1
    ram[part] += $2
} END { for (part in flash) printf "%6d %6d  %s\n", flash[part], ram[part], part }' | sort -k1,1nr -k2,2nr
echo
symbols
