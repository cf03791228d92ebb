#!/bin/sh
# Runs a test program for cargo, and keeps the times of its tests in target/times. The stable libtest measures them only with
# this variable, which no compiler sees: no test starts one.
times=$(cd "$(dirname "$0")/.." && pwd)/target/times
mkdir -p "$times"
RUSTC_BOOTSTRAP=1 exec "$@" -Z unstable-options --report-time --logfile "$times/$(basename "$PWD") $(basename "$1")"
