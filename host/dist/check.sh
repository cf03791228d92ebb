#!/bin/sh
# Works with the `biflag` on the PATH of a computer that has no compilers: what host/dist/test.sh runs in a plain Debian.
set -eu

for tool in rustc cargo cc gcc avr-gcc git; do
    if command -v $tool > /dev/null; then
        echo "$tool is installed: this computer shows nothing" >&2
        exit 1
    fi
done
cd "$(mktemp -d)"
export XDG_CONFIG_HOME="$PWD/config"

# Runs a command, which must end with this exit code.
expect() {
    wanted=$1
    shift
    code=0
    "$@" > output 2>&1 || code=$?
    if [ $code != "$wanted" ]; then
        cat output
        echo "exit code $code instead of $wanted: $*" >&2
        exit 1
    fi
    echo "ok ($code): $*"
}

# The output of the last command must have a line with this text.
says() {
    if ! grep -q "$1" output; then
        cat output
        echo "no \"$1\" in the output" >&2
        exit 1
    fi
}

expect 0 biflag --version
commit=$(biflag --version | sed 's/.*(\([0-9a-f]*\).*/\1/')

# No board is plugged in, and all else is well.
expect 3 biflag doctor
says "ok  *firmware: .*, inside biflag"
says "ok  *avrdude: version"
says "ok  *emulated board: /"
says "no board is plugged in"

mkfifo control
for bootloader in optiboot old; do
    vnano --bootloader $bootloader < control > board &
    exec 3> control
    until grep -q '"event":"ready"' board; do sleep 0.1; done
    port=$(sed -n 's/.*"port":"\([^"]*\)".*/\1/p' board)
    expect 0 biflag flash --port "$port"
    says "runs firmware $commit"
    # A board that is new has no settings.
    expect 3 biflag doctor --port "$port"
    expect 0 biflag settings --new --port "$port"
    expect 0 biflag doctor --port "$port"
    exec 3>&-
    wait
done

cat > plan.toml <<END
[session]
name = "short"
[trial]
calibrate = 1
preroll = 2
run = 6
decay = 2
[speeds]
pairs = [[50, 10]]
END
expect 0 biflag record plan.toml --virtual --out recorded
expect 0 biflag info recorded
expect 0 biflag simulate published-points --out points
expect 0 biflag simulate --speeds=50,10 --duration 60 --robot robot-tank --out tank
expect 0 biflag report points
test -s points/report.html
expect 0 biflag export points
