#!/bin/sh
# Load URDF and SRDF of each model with programs of others: make test-urdf. Pinocchio (which reads a URDF with urdfdom,
# as MoveIt does) and Tesseract get an environment of their own in .venv-urdf, made once: 0.7 GB. Where that cannot be,
# it says so, and nothing fails.
#
# PYTHON: the interpreter that the environment is made with (python3)
# TESTS: what pytest is to run (tests/urdf/live.py)
set -eu
cd "$(dirname "$0")/../.."
name=urdf
. tests/environment.sh

[ "$(uname -s)-$(uname -m)" = Linux-x86_64 ] || skip "tried on Linux on x86-64 alone"
if [ ! -f "$venv/.complete" ]; then
    echo "Setting up $venv, once (this takes a minute)"
    "$PYTHON" -m venv --clear "$venv"
    "$python" -m pip install --quiet --disable-pip-version-check uv || skip "pip cannot get uv"
    timeout 600 "$python" -m uv pip install --quiet --python "$python" pin==4.1.0 tesseract-robotics==0.5.1 \
        hypothesis pytest pytest-asyncio -e . || skip "Pinocchio and Tesseract cannot be installed (see above)"
    touch "$venv/.complete"
fi
echo "== $("$python" -c 'from importlib.metadata import version as v
print(*(f"{name} {v(name)}" for name in ("pin", "cmeel-urdfdom", "tesseract-robotics")))')"
# shellcheck disable=SC2086
"$python" -m pytest -rs ${TESTS:-tests/urdf/live.py}
