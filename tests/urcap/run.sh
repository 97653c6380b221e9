#!/bin/sh
# Drive the simulated URCap with clients of others: make test-urcap. It gets an environment of its own in .venv-urcap,
# made once: 0.4 GB, for airo-robots brings scipy and more. Where that cannot be, it says so, and nothing fails.
#
# PYTHON: the interpreter that the environment is made with (python3)
# RUN: a module that is run in place of the tests: make race
# TESTS: what pytest is to run (tests/urcap/live.py and tests/link/test_urcap_clients.py)
set -eu
cd "$(dirname "$0")/../.."
name=urcap
. tests/environment.sh

if [ ! -f "$venv/.complete" ]; then
    echo "Setting up $venv, once (this takes a minute)"
    "$PYTHON" -m venv --clear "$venv"
    "$python" -m pip install --quiet --disable-pip-version-check uv || skip "pip cannot get uv"
    # Of rcs-ur5e only one file is used, which needs nothing of what the package does.
    {
        timeout 600 "$python" -m uv pip install --quiet --python "$python" airo-robots pyrobotiqur \
            hypothesis pytest pytest-asyncio -e '.[serial]' &&
            timeout 60 "$python" -m uv pip install --quiet --python "$python" --no-deps rcs-ur5e
    } || skip "the clients cannot be installed (see above)"
    touch "$venv/.complete"
fi
echo "== $("$python" -c 'from importlib.metadata import version as v
print(*(f"{name} {v(name)}" for name in ("airo-robots", "pyrobotiqur", "rcs-ur5e")))')"
# shellcheck disable=SC2086
[ -z "${RUN:-}" ] || exec "$python" -m $RUN
# shellcheck disable=SC2086
"$python" -m pytest -rs ${TESTS:-tests/urcap/live.py tests/link/test_urcap_clients.py}
