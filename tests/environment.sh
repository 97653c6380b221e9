# Read by the scripts that run tests in an environment of their own, in the folder of the project, with $name set.
# It gives them $PYTHON, $venv, $python and skip(), and forgets an environment that is older than what it is made by.
#
# shellcheck shell=sh disable=SC2034,SC2154
PYTHON=${PYTHON:-python3}
venv=.venv-$name
python=$venv/bin/python
unset PYTHONPATH VIRTUAL_ENV

skip() {
    rm -rf "$venv"
    echo "test-$name: SKIPPED: $1"
    exit 0
}

for source in pyproject.toml tests/environment.sh "tests/$name/run.sh"; do
    [ "$venv/.complete" -nt "$source" ] || rm -f "$venv/.complete"
done
