# Needs Python 3.11 or newer with pip and venv, and make. Everything else goes into .venv.
#
# Another interpreter than python3:  make demo PYTHON=python3.12
# Another gripper than the simulated one:  make demo ADDRESS=tcp://192.168.1.11   (it asks before it moves)

PYTHON ?= python3
ADDRESS ?= sim://
MINUTES ?= 30
MODEL ?= 3f
LINK ?= tcp
HANDS ?= 1
SILENT ?= 0
HABITS ?= status-lag; silence-fault; write-spacing
DISTROS ?= jazzy kilted
PYTHONS ?= 3.12 3.13 3.14
VENV := .venv
BIN := $(VENV)/bin
# Touched last, so it stands for a complete environment.
STAMP := $(VENV)/.complete
# The site and the releases have environments of their own: nothing of theirs is needed to work on the library.
SITE := $(VENV)-site
RELEASE := $(VENV)-release

# The caller's environment must not leak into ours: an active venv or a PYTHONPATH would shadow it, and without
# bytecode each of the hundreds of processes that the tests start compiles all of its modules again.
unexport VIRTUAL_ENV CONDA_PREFIX PYTHONHOME PYTHONPATH PYTHONSTARTUP PIP_USER PIP_TARGET PIP_PREFIX UV_PYTHON
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo show smoke test-core test test-web test-ros2 test-lerobot test-urcap test-upstream race test-urdf pages docs dist pythons canary typed soak habits fuzz explore bench lint check format constraints clean

help:  ## Show this list; times are those of two idle cores, without setting up the environment (once, a minute)
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(STAMP)  ## Run the demo on a simulated gripper (30 s; ADDRESS=... for a real one: it asks, and moves)
	@$(BIN)/python -m robotiq_async demo $(ADDRESS)
	@echo; echo "To see the hand itself, moving in your browser: make show"

show: $(STAMP)  ## Run the demo with the hand in three dimensions on a page in your browser (30 s)
	@$(BIN)/python -m robotiq_async demo --show $(ADDRESS)

smoke: $(STAMP)  ## Try a bit of everything; the first thing to run after a change (20 s)
	@$(BIN)/python -m pytest --numprocesses auto --dist worksteal @tests/smoke.txt

test-core: $(STAMP)  ## Run the tests of the core: values, control, link, hands, simulator, sync (1 minute)
	@$(BIN)/python -m pytest -rs --numprocesses auto --dist worksteal @tests/core.txt

test: $(STAMP)  ## Run the tests (5 minutes); those that need a browser, ROS or other environments are test-web, test-ros2, test-lerobot, test-urcap, test-urdf and pages
	@$(BIN)/python -m pytest -rs --numprocesses auto --dist worksteal

test-web: $(STAMP)  ## Test the page in a real browser (Debian: chromium, chromium-driver); skipped where there is none
	@$(BIN)/python -m pytest -rs tests/web/in_browser.py

test-ros2:  ## Test the ROS 2 node with real clients, each ROS in an environment of its own (DISTROS="jazzy kilted")
	@PYTHON="$(PYTHON)" tests/ros2/run.sh $(DISTROS)

test-lerobot:  ## Test the robot with the commands of LeRobot, in an environment of its own (Python 3.12, 5.7 GB)
	@PYTHON="$(PYTHON)" tests/lerobot/run.sh

test-urcap:  ## Drive the simulated URCap with clients of others, in an environment of its own (30 s, 0.4 GB)
	@PYTHON="$(PYTHON)" tests/urcap/run.sh

race:  ## Programs of others and the drop-ins on the same bad lines, as a table (an hour; the environment of test-urcap)
	@PYTHON="$(PYTHON)" RUN="tests.dropins.race $(ARGUMENTS)" tests/urcap/run.sh

test-upstream:  ## Run GELLO, polymetis' client and DROID's robot, of SOURCES=FOLDER, at the drop-ins (1 minute, 0.2 GB)
	@PYTHON="$(PYTHON)" SOURCES="$(SOURCES)" tests/upstream/run.sh

test-urdf:  ## Load URDF and SRDF with Pinocchio and Tesseract, in an environment of its own (10 s, 0.7 GB)
	@PYTHON="$(PYTHON)" tests/urdf/run.sh

pages: $(STAMP)  ## Run the code of every page in the environment that the page names (needs the package index)
	@$(BIN)/python -m pytest --numprocesses auto tests/docs/environments.py

docs: $(SITE)/.complete  ## Make the documentation site in site/, strictly: no dead links, nothing from other hosts (10 s)
	@$(SITE)/bin/python -m docs.site

dist: $(RELEASE)/.complete  ## Build sdist and wheels in dist/, and try each in a bare environment (30 s; needs the package index)
	@$(RELEASE)/bin/python -m tests.release.dist

pythons: $(RELEASE)/.complete  ## Test the core on other Pythons (PYTHONS="3.12 3.13 3.14"); one that cannot be had is named
	@$(RELEASE)/bin/python -m tests.release.pythons $(PYTHONS)

canary: $(RELEASE)/.complete  ## Test with the newest of all dependencies, in an environment that is thrown away (PYMODBUS="pymodbus>=4.0.0.dev0")
	@PYMODBUS="$(PYMODBUS)" $(RELEASE)/bin/python -m tests.release.canary

typed: $(RELEASE)/.complete  ## Count the names whose type pyright knows; fewer than 98 % fail (a minute; needs the package index and npm's)
	@$(RELEASE)/bin/python -m tests.release.typed

soak: $(STAMP)  ## Move a MODEL=3f under random faults for MINUTES=30 over LINK=tcp (rtu, urcap, tunnel), and print figures; with VIRTUAL=1 in a twentieth of the time
	@$(BIN)/python -m tests.adversity.soak --minutes $(MINUTES) --link $(LINK) --model $(MODEL) --hands $(HANDS) --silent $(SILENT) $(if $(VIRTUAL),--virtual --starved)

habits: $(STAMP)  ## Everything under fault once more, with HABITS="status-lag; silence-fault; write-spacing"
	@HABITS="$(HABITS)" $(BIN)/python -m pytest tests/adversity

fuzz: $(STAMP)  ## A million mutated replies through the decoder, 100,000 through a live link
	@$(BIN)/python -m tests.adversity.fuzz

explore: $(STAMP)  ## Try random examples that the tests do not, for some minutes
	@$(BIN)/python -m tests.link.lives
	@HYPOTHESIS_PROFILE=explore $(BIN)/python -m pytest -o hangs_after=1800 \
		tests/adversity/test_model.py tests/control/test_random.py tests/control/test_lives.py
	@$(BIN)/python -m tests.adversity.held_part --lives 60

bench: $(STAMP)  ## Measure steadiness and cost beside bare pymodbus and a C thread (12 minutes; needs gcc)
	@$(BIN)/python -m tests.benchmarks --json benchmarks.json

lint: $(STAMP)  ## Check style, types and the directions of the imports (30 s)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo --no-cache

check: lint test test-web test-ros2 pages docs dist pythons  ## Everything CI runs

format: $(STAMP)  ## Put the sources into shape
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

constraints: $(STAMP)  ## Take the newest versions of all dependencies into constraints.txt
	$(BIN)/python -m uv pip compile --quiet --universal --upgrade --all-extras --no-header --no-annotate \
		pyproject.toml --output-file constraints.txt
	$(BIN)/python -m uv pip compile --quiet --universal --upgrade --python-version 3.11 --no-header --no-annotate \
		docs/site/requirements.in --output-file docs/site/requirements.txt
	$(BIN)/python -m uv pip compile --quiet --universal --upgrade --python-version 3.11 --generate-hashes --no-header \
		--no-annotate --constraints constraints.txt tests/release/requirements.in --output-file tests/release/requirements.txt

clean:  ## Remove what the other commands made
	rm -rf $(VENV) $(SITE) $(RELEASE) .venv-ros2 .venv-lerobot .venv-lerobot-uv .venv-urcap .venv-upstream .venv-urdf build dist site .cache .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage htmlcov
	find robotiq_async tests demo -type d -name __pycache__ -prune -exec rm -rf {} +

# uv is several times quicker than pip, but nothing depends on it. When it fails, whatever the reason, pip does
# the work or says what is wrong.
$(STAMP): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { \
		echo "There is no '$(PYTHON)' here. robotiq_async needs Python 3.11 or newer:" \
			"make PYTHON=/path/to/python3.11 ..." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "robotiq_async needs Python 3.11 or newer, and '$(PYTHON)' is $$($(PYTHON) --version 2>&1)." \
			"Name another one: make PYTHON=/path/to/python3.11 ..." >&2; exit 1; }
	@echo "Setting up $(VENV), once (this takes up to a minute)"
	@$(PYTHON) -m venv --clear $(VENV) || { \
		echo "'$(PYTHON) -m venv' failed; on Debian and Ubuntu it needs the package python3-venv." >&2; exit 1; }
	@{ $(BIN)/python -m pip install --quiet --disable-pip-version-check uv \
		&& $(BIN)/python -m uv pip install --quiet --python $(BIN)/python -c constraints.txt -e '.[all,dev]'; \
		} >/dev/null 2>&1 \
		|| { echo "uv did not work here; installing with pip, which takes a little longer"; \
			$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[all,dev]'; } \
		|| { echo "Installing the dependencies failed (see above). The package index must be reachable, once." >&2; exit 1; }
	@touch $@

$(SITE)/.complete: docs/site/requirements.txt constraints.txt
	@echo "Setting up $(SITE), once"
	@$(PYTHON) -m venv --clear $(SITE)
	@$(SITE)/bin/python -m pip install --quiet --disable-pip-version-check --requirement docs/site/requirements.txt
	@# Only for its copy of Mermaid, which draws the diagrams.
	@$(SITE)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps -c constraints.txt nicegui
	@touch $@

$(RELEASE)/.complete: tests/release/requirements.txt
	@$(PYTHON) -m venv --clear $(RELEASE)
	@$(RELEASE)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes \
		--requirement tests/release/requirements.txt
	@touch $@
