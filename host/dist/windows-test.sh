#!/bin/sh
# Works with biflag.exe under Wine, and compares what it computes with this computer's biflag. After host/dist/windows.sh.
set -eu
cd "$(dirname "$0")/../.."
root=$PWD
target=x86_64-pc-windows-gnu
built=$PWD/target/$target/release
biflag=$PWD/target/release/biflag
export WINEPREFIX="$PWD/target/wine" WINEDEBUG=-all WINEDLLOVERRIDES="mscoree,mshtml=" XDG_CONFIG_HOME="$PWD/target/wine/config"
begun=$(date +%s)

# The pseudo-terminal /dev/pts/N is COM(N + 10), and numbers have a decimal comma.
mkdir -p "$WINEPREFIX"
{
    printf 'REGEDIT4\n\n[HKEY_CURRENT_USER\\Control Panel\\International]\n"sDecimal"=","\n[HKEY_LOCAL_MACHINE\\Software\\Wine\\Ports]\n'
    for number in $(seq 0 240); do printf '"COM%d"="/dev/pts/%d"\n' $((number + 10)) "$number"; done
} > "$WINEPREFIX/test.reg"
wine regedit /S "$WINEPREFIX/test.reg" > "$PWD/target/wine.log" 2>&1
# Ports are read when Wine starts. It goes on until the end of this.
/usr/lib/wine/wineserver -w
/usr/lib/wine/wineserver -p 2>> "$PWD/target/wine.log"

stub=$WINEPREFIX/bcryptprimitives.dll
x86_64-w64-mingw32-gcc -shared -o "$stub" host/dist/bcryptprimitives.c -ladvapi32
mkdir -p "$built/deps"
cp "$stub" "$built/deps"
export CARGO_TARGET_X86_64_PC_WINDOWS_GNU_RUNNER=wine
sh host/dist/windows-cargo.sh test -p system --lib
sh host/dist/windows-cargo.sh test -p sim --lib same_bits

# As a user has it: in a folder with spaces and letters beyond ASCII.
scratch=$(mktemp -d)
trap '/usr/lib/wine/wineserver -k; rm -r "$scratch"' EXIT
unzip -q target/dist/biflag-*-windows-x86_64.zip -d "$scratch"
exe=$(echo "$scratch"/biflag-*/biflag.exe)
cp "$stub" "${exe%/*}"
helper=$scratch/helper.exe
x86_64-w64-mingw32-gcc -O1 -Wall -o "$helper" host/dist/windows-helper.c
work="$scratch/Prüfung im Labor"
mkdir "$work"
cp host/plans/published-points.toml "$work"
cd "$work"

# Runs a command of biflag.exe, which must end with this exit code.
expect() {
    wanted=$1
    shift
    rm -f exit-code
    wine "$helper" run exit-code "$exe" "$@" > output 2>&1 || true
    code=$(cat exit-code || echo none)
    if [ $code != "$wanted" ]; then
        cat output
        echo "exit code $code instead of $wanted: biflag $*" >&2
        exit 1
    fi
    echo "ok ($code): biflag $*"
}

# The output of the last command must have a line with this text.
says() {
    if ! grep -q -- "$1" output; then
        cat output
        echo "no \"$1\" in the output" >&2
        exit 1
    fi
}

# Files of both systems must be the same, but for the names and hashes of logs, which have the time in them.
same() {
    grep -v '^# \(log\|SHA-256\)' "$1" > one
    grep -v '^# \(log\|SHA-256\)' "$2" > other
    cmp one other
    echo "the same, byte for byte: $1"
}

expect 0 --version
start=$(date +%s%N)
wine "$exe" --version > output || [ $? = 137 ]
echo "biflag.exe --version under Wine: $((($(date +%s%N) - start) / 1000000)) ms"

expect 0 simulate --speeds=50,10 --duration 60 --out wine
$biflag simulate --speeds=50,10 --duration 60 --out linux > /dev/null 2>&1
expect 0 export wine
$biflag export linux > /dev/null
for file in wine-export/*.csv; do
    same "$file" "linux-export/${file#*/}"
done

# As Notepad writes it.
printf '\357\273\277[session]\r\nname = "softer"\r\nrobot = "physical"\r\n[vary]\r\n"group.stiffness" = [0.8, 1.0]\r\n' > softer.toml
printf '[trial]\r\nrun = 60\r\nmethod = "steady"\r\n[speeds]\r\npairs = [[50, 10], [0, 45]]\r\n' >> softer.toml
expect 0 sweep softer.toml --out wine-sweep
$biflag sweep softer.toml --out linux-sweep > /dev/null 2>&1
same wine-sweep/table.csv linux-sweep/table.csv
expect 0 aim --yaw=-67 --pitch=-4 -o wine/aim.toml
$biflag aim --yaw=-67 --pitch=-4 -o linux/aim.toml > /dev/null 2>&1
same wine/aim.toml linux/aim.toml
$biflag record demo --virtual --out demo > /dev/null 2>&1
expect 0 calibrate demo -o wine/fitted.toml
$biflag calibrate demo -o linux/fitted.toml > /dev/null 2>&1
same wine/fitted.toml linux/fitted.toml
expect 2 record demo --virtual
says "WSL"

expect 0 report wine
expect 0 figure trial wine 1 -o trial.pdf
expect 0 figure trial wine 1 -o trial.svg
grep -v '^#' wine-export/001_w1+50_w2+10.csv | cut -d , -f 1,3-5 > camera.csv
expect 0 import camera.csv --columns time=time_s,yaw=yaw_deg,pitch=pitch_deg,roll=roll_deg --speeds 50,10 --run 0,60 --robot physical -o camera.mcap
expect 0 info camera.mcap
expect 0 compare wine
expect 0 pack wine --license CC-BY-4.0
unzip -tq wine.zip
head -c 60000 wine/001_w1+50_w2+10.mcap > cut.mcap
expect 3 recover cut.mcap
expect 3 info cut.recovered.mcap
for words in plans resistance "completions powershell" "new new.toml" "plan check new.toml" "doctor wine"; do
    expect 0 $words
done
wine "$exe" live wine/001_w1+50_w2+10.mcap --listen 127.0.0.1:0 > served 2>&1 &
viewed=$!
until grep -q waiting served; do sleep 0.1; done
python3 - "$(sed -n 's,^live at ws://127.0.0.1:\([0-9]*\):.*,\1,p' served)" << 'END'
import socket, sys
with socket.create_connection(("127.0.0.1", int(sys.argv[1])), 10) as viewer:
    viewer.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                   b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n")
    assert viewer.recv(4096).startswith(b"HTTP/1.1 101"), "no viewer can connect"
END
kill -INT $viewed
wait $viewed || [ $? = 130 ]
echo "ok: biflag live"

. "$root/host/dist/windows-bench.sh"
echo "All of this works under Wine, in $(($(date +%s) - begun)) s."
