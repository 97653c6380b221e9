#!/bin/sh
# Test the ROS 2 node with real clients: make test-ros2. Each distribution that is named (jazzy, kilted) gets an
# environment of its own below .venv-ros2, made once. Where that cannot be, it says so, and nothing fails.
#
# PYTHON: the interpreter that the environments are made with (python3)
# TESTS: what pytest is to run (all of tests/ros2/live)
set -eu
cd "$(dirname "$0")/../.."
PYTHON=${PYTHON:-python3}
HERE=tests/ros2/environment
# Those of another ROS would be found before the environment's own.
unset LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE AMENT_PREFIX_PATH PYTHONPATH VIRTUAL_ENV

skip() {
    echo "test-ros2: SKIPPED: $1"
    exit 0
}

[ "$(uname -s)-$(uname -m)" = Linux-x86_64 ] || skip "the wheels of ROS 2 are for Linux on x86-64"
command -v "${CXX:-c++}" >/dev/null || skip "no C++ compiler, control_msgs cannot be made (Debian: g++)"
"$PYTHON" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' ||
    skip "the wheels of ROS 2 are for Python 3.11 to 3.13, and this is $("$PYTHON" --version 2>&1)"
headers=$("$PYTHON" -c 'import sysconfig; print(sysconfig.get_paths()["include"])')
[ -f "$headers/Python.h" ] || skip "no $headers/Python.h, control_msgs cannot be made (Debian: python3-dev)"

environment() { # make it unless it is there and fresh
    venv=.venv-ros2/$1
    python=$venv/bin/python
    for source in pyproject.toml $HERE/"$1".txt $HERE/build_interface.py $HERE/control_msgs/action/*; do
        [ "$venv/.complete" -nt "$source" ] || rm -f "$venv/.complete"
    done
    [ ! -f "$venv/.complete" ] || return 0
    echo "Setting up $venv, once (this takes up to a minute)"
    "$PYTHON" -m venv --clear "$venv"
    "$python" -m pip install --quiet --disable-pip-version-check uv
    "$python" -m uv pip install --quiet --python "$python" -c constraints.txt -r $HERE/"$1".txt \
        hypothesis pytest pytest-asyncio pytest-xdist -e '.[fleet]'
    "$python" $HERE/build_interface.py $HERE/control_msgs >/dev/null
    touch "$venv/.complete"
}

for distro in "$@"; do
    environment "$distro"
    echo "== ROS 2 $distro: $(.venv-ros2/"$distro"/bin/python -c \
        'from importlib.metadata import version as v; print("rclpy", v("ros-rclpy"))')"
    # Nearly all of the time the tests wait for motions: more at once than there are cores.
    # shellcheck disable=SC2086
    .venv-ros2/"$distro"/bin/python -m pytest -p tests.ros2.live.fixtures --numprocesses 3 --dist loadfile \
        ${TESTS:-tests/ros2/live/goals.py tests/ros2/live/lifecycle.py tests/ros2/live/topics.py \
        tests/ros2/live/failures.py tests/ros2/live/bridge.py tests/ros2/live/messages.py \
        tests/ros2/live/installed.py tests/ros2/live/other_host.py tests/ros2/live/description.py}
done
