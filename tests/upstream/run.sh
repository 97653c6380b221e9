#!/bin/sh
# Run programs of labs that no package index has, from sources that you have fetched: make test-upstream SOURCES=FOLDER.
# FOLDER holds clones, or the files that are named in live.py: gello_software, fairo (polymetis), droid. They get an
# environment of their own in .venv-upstream, made once: 0.1 GB. Where that cannot be, it says so, and nothing fails.
#
# PYTHON: the interpreter that the environment is made with (python3)
# SOURCES: the folder
# TESTS: what pytest is to run (tests/upstream/live.py)
set -eu
cd "$(dirname "$0")/../.."
name=upstream
. tests/environment.sh

[ -n "${SOURCES:-}" ] || { echo "test-upstream: SKIPPED: no SOURCES=FOLDER with clones of what no index has"; exit 0; }
if [ ! -f "$venv/.complete" ]; then
    echo "Setting up $venv, once (this takes a minute)"
    "$PYTHON" -m venv --clear "$venv"
    "$python" -m pip install --quiet --disable-pip-version-check uv || skip "pip cannot get uv"
    timeout 600 "$python" -m uv pip install --quiet --python "$python" numpy grpcio-tools 'setuptools<81' \
        hypothesis pytest pytest-asyncio -e '.[serial,grpc]' || skip "its packages cannot be installed (see above)"
    touch "$venv/.complete"
fi
export SOURCES
# shellcheck disable=SC2086
"$python" -m pytest -rs ${TESTS:-tests/upstream/live.py}
