#!/bin/sh
# Test the robot with the commands of the real LeRobot: make test-lerobot. It gets an environment of its own in
# .venv-lerobot, made once: 5.7 GB, for its torch is a CUDA build. Where that cannot be, it says so, and nothing fails.
#
# PYTHON: an interpreter that is taken if it is 3.12 or newer (python3); else python3.12, also one that uv can get
# TESTS: what pytest is to run (tests/lerobot/live.py)
set -eu
cd "$(dirname "$0")/../.."
name=lerobot
. tests/environment.sh
LEROBOT='lerobot[core_scripts,training]==0.6.1'

fits() { # pyenv's commands do nothing unless they know which version is meant
    PYENV_VERSION=${2:-} "$1" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null
}

interpreter() { # print one that LeRobot can have
    if fits "$PYTHON"; then
        echo "$PYTHON"
    elif fits python3.12 3.12; then
        PYENV_VERSION=3.12 python3.12 -c 'import sys; print(sys.executable)'
    else
        "$venv-uv/bin/uv" python install --quiet 3.12 2>/dev/null && "$venv-uv/bin/uv" python find 3.12
    fi
}

if [ ! -f "$venv/.complete" ]; then
    free=$(df -Pk . | awk 'NR == 2 { print int($4 / 1024 / 1024) }')
    [ "$free" -ge 14 ] || skip "the environment needs 14 GB while it is made, and $free GB are free"
    "$PYTHON" -m venv --clear "$venv-uv"
    "$venv-uv/bin/python" -m pip install --quiet --disable-pip-version-check uv || skip "pip cannot get uv"
    found=$(interpreter) || skip "LeRobot needs Python 3.12, which is not here, and uv cannot get it"
    echo "Setting up $venv, once (this takes one to ten minutes)"
    "$found" -m venv --clear "$venv"
    # Constraints would hold numpy above what LeRobot takes.
    timeout 900 "$venv-uv/bin/uv" pip install --quiet --python "$python" "$LEROBOT" hypothesis pytest pytest-asyncio \
        -e '.[record,serial]' ./packaging/lerobot_robot_robotiq ||
        skip "$LEROBOT cannot be installed (see above)"
    touch "$venv/.complete"
fi
echo "== $("$python" -c 'from importlib.metadata import version as v; print("lerobot", v("lerobot"), "torch", v("torch"))')"
# shellcheck disable=SC2086
"$python" -m pytest -o hangs_after=300 ${TESTS:-tests/lerobot/live.py}
