#!/bin/sh
# biflag.exe ($BIFLAG_EXE) under Wine in the place of biflag: the port /dev/pts/N of an emulated board is COM(N + 10) there.
# The settings of a new board come from this computer's biflag: the time of a board that is faster than real time waits for signs of
# the program at its port, which biflag gives to pseudo-terminals only.
[ "$1" != settings ] || exec "$(dirname "$0")/../../target/release/biflag" "$@"
for word; do
    shift
    case $word in
        /dev/pts/*) word=COM$((${word#/dev/pts/} + 10)) ;;
    esac
    set -- "$@" "$word"
done
# A recording is killed by its process.
[ "$1" != record ] || exec wine "$BIFLAG_EXE" "$@"
rm -f exit-code
wine "$BIFLAG_HELPER" run exit-code "$BIFLAG_EXE" "$@"
exit "$(cat exit-code)"
