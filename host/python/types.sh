#!/bin/sh
# Checks the types of the package, of its tests, and of the stub of its library, after `make python`.
set -eu
cd "$(dirname "$0")"
target=$(cd ../../target && pwd)
tools=$(dirname "$(sh ../../tests/python.sh newest)")
export PYTHONPATH="$target/python" MYPYPATH="$target/python" MYPY_CACHE_DIR="$target/tmp/mypy"
rm -rf "$PYTHONPATH"
sh lay.sh "$PYTHONPATH"
"$tools/mypy" --strict -p biflag
"$tools/mypy" --strict conftest.py tests
"$tools/stubtest" biflag._biflag
