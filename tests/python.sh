#!/bin/sh
# Makes the Python environment of the tests, in target/tmp, and prints the path of its Python. If it is there, it only prints.
#
#   tests/python.sh newest   the newest Python at hand, with everything that the tests import
#   tests/python.sh oldest   the oldest from 3.10 on, with what the package itself needs
set -eu
cd "$(dirname "$0")/.."
requirements=host/python/tests/requirements.txt
[ "$1" = oldest ] || requirements="$requirements host/python/tests/requirements-newest.txt tests/requirements.txt"
venv=$PWD/target/tmp/python-$1
python=$venv/bin/python

# Tests run at the same time: the first that comes makes the environment, the others wait for it.
mkdir -p target/tmp
exec 9>"$venv.lock"
flock 9
if ! cat $requirements | cmp -s - "$venv/ready"; then
    # Those on the PATH and those of pyenv that can make environments, by their minor versions.
    found=$(for candidate in python3 $(seq -f python3.%g 10 20) "${PYENV_ROOT:-$HOME/.pyenv}"/versions/*/bin/python3; do
        "$candidate" -c 'import ensurepip, sys, venv; print(sys.version_info[1], sys.executable)' 2>/dev/null || :
    done | awk '$1 >= 10' | sort -n)
    [ -n "$found" ] || { echo "There is no Python from 3.10 on with venv: install python3-venv." >&2; exit 1; }
    [ "$1" = oldest ] && chosen=$(echo "$found" | head -n 1) || chosen=$(echo "$found" | tail -n 1)
    "${chosen#* }" -m venv --clear "$venv"
    "$python" -m pip install -q -r tests/requirements-uv.txt >&2
    # uv takes a third of the time of pip. The certificates of the system, as pip.
    "$python" -m uv pip install -q --native-tls --python "$python" $(printf -- '-r %s ' $requirements) >&2
    cat $requirements > "$venv/ready"
fi
echo "$python"
