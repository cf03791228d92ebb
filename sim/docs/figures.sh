#!/bin/sh
# Prints what each check of the tests of `sim` measured, beside its bound: `sh sim/docs/figures.sh > sim/docs/figures.md`.
# Fails where a check does.
set -eu
cd "$(dirname "$0")/../.."
out=$(mktemp)
trap 'rm -f "$out"' EXIT
cargo test --release --locked -p sim --test all -- --nocapture >"$out" 2>/dev/null || { grep FAILS "$out" >&2; exit 1; }
# With one thread the name of a test is before its first row.
rows=$(grep -E '(holds|FAILS) \|$' "$out" | grep -o '|.*' | LC_ALL=C sort)
cat <<HEAD
# Figures of the checks

\`sh sim/docs/figures.sh\` printed this page: all $(echo "$rows" | wc -l) rows that \`cargo test --release -p sim -- --nocapture\` prints, by name.
[proof.md](proof.md) says what each is compared with. Figures of the model are the same on every processor.

| check | measured | bound | |
| --- | --- | --- | --- |
$rows
HEAD
