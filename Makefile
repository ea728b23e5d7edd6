# Needs python3 with venv, and make. A sourced ROS 2 is used as it is; else its wheels are installed.
PYTHON ?= python3
VENV ?= .venv
CONTRIB_VENV := .venv-contrib
OLDEST_VENV := .venv-oldest
AUDIT_VENV := .venv-audit
OLDEST_PYTHON ?= $(firstword $(foreach v,3.12 3.11 3.10,$(shell python$(v) -c 'import venv' 2>/dev/null && echo python$(v))) $(PYTHON))

ROS := $(if $(ROS_DISTRO),$(shell $(PYTHON) -c 'import rclpy' 2>/dev/null && echo sourced))
# ROS 2 from apt was compiled against the numpy beside it: stay on that numpy's side of 2.0.
NUMPY_1 := $(if $(ROS),$(shell $(PYTHON) -c 'import numpy; assert numpy.__version__ < "2"' 2>/dev/null && echo yes))

RUN_LOCKS := $(if $(NUMPY_1),requirements/oldest.txt,requirements/runtime.txt $(if $(ROS),,requirements/ros.txt))
TEST_LOCKS := $(if $(NUMPY_1),,requirements/dev.txt) $(if $(ROS),,requirements/ament.txt)

KIND := $(if $(ROS),$(ROS_DISTRO),wheels)
RUN_STAMP := $(VENV)/.run-$(KIND)
TEST_STAMP := $(VENV)/.test-$(KIND)
LINT_STAMP := $(VENV)/.lint-$(KIND)
BIN := $(VENV)/bin
# The locks are complete: without --no-deps pip would resolve again, and trip over the extras of a
# package that has a newer release than its lock.
PIP_INSTALL := -m pip --disable-pip-version-check install --quiet --no-deps
PIP := $(BIN)/python $(PIP_INSTALL)
OLDEST_PIP := $(OLDEST_VENV)/bin/python $(PIP_INSTALL)

# Tests of the kernels: run compiled with all others, and once more as plain Python.
KERNEL_TESTS := $(wildcard test/graph test/matching test/refinement test/quality)
# What asks about sources and texts, not about what they do.
FORM_TESTS := test/test_ament_lint.py test/test_house.py test/test_generated_files.py
# Four processes, a file of tests at a time, in the order of the folders: many tests wait.
SIDE_BY_SIDE := -n 4 --dist loadfile --no-loadscope-reorder
# All that needs no ROS.
CORE_TESTS := $(KERNEL_TESTS) $(wildcard test/evaluation test/datasets test/rectification test/health \
	test/test_images.py test/test_levels.py $(wildcard test/test_pipeline*.py) test/test_decoding.py test/test_params.py \
	test/test_grey_range.py test/test_pairing.py test/test_memory.py test/test_stop.py \
	test/test_threads.py)

export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
# The tests start hundreds of processes: each would parse all sources again.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo test test-oldest coverage lint audit bench bench-live bench-two-hosts soak fuzz tables lock clean

help:
	@echo 'make demo        live node, replayed stereo pair, pictures in demo_output/'
	@echo 'make test        the whole test suite'
	@echo 'make test-oldest the core against the oldest supported dependencies'
	@echo 'make coverage    lines of the package that the tests run, at least 95 %'
	@echo 'make lint        ruff, mypy, ament_flake8, ament_pep257, ament_copyright'
	@echo 'make audit       known vulnerabilities of the locked dependencies (asks the network)'
	@echo 'make bench       speed and error beside OpenCV, docs/speed.svg'
	@echo 'make bench-live  camera and node over DDS: rate, latency, drops, memory'
	@echo 'make soak        camera and node over DDS with faults, SOAK_SECONDS=1800; every pair accounted for'
	@echo 'make fuzz        malformed messages through the conversions and a node'
	@echo 'make bench-two-hosts  camera and node in two network namespaces, clean and lossy (root)'
	@echo 'make tables      docs/parameters.md and config/live.yaml, from stereo_refine_ros/params.py'
	@echo 'make lock        requirements/*.txt from *.in (needs uv)'
	@echo 'make clean       remove what make made'

demo: $(RUN_STAMP)
	$(BIN)/python -m demo

# The kernels are compiled once, beside the tests that need none, and not by every process.
test: $(TEST_STAMP)
	$(BIN)/python -m stereo_refine_ros.warm_up --preset live > $(VENV)/warm_up.log 2>&1 & \
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -q -m 'not compiled' $(SIDE_BY_SIDE) \
		$(KERNEL_TESTS) $(FORM_TESTS); status=$$?; wait; exit $$status
	$(BIN)/python -m pytest $(SIDE_BY_SIDE) $(FORM_TESTS:%=--ignore=%)

test-oldest: $(OLDEST_VENV)/.installed
	$(OLDEST_VENV)/bin/python -m pytest -m 'not ros' $(SIDE_BY_SIDE) $(CORE_TESTS)

# Kernels are seen by coverage only as plain Python; the rest runs compiled, in all its processes.
coverage: $(TEST_STAMP)
	$(BIN)/python -m coverage erase
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m coverage run -m pytest -q -m 'not compiled' \
		$(SIDE_BY_SIDE) $(KERNEL_TESTS)
	$(BIN)/python -m coverage run -m pytest -q $(SIDE_BY_SIDE)
	$(BIN)/python -m coverage combine -q
	$(BIN)/python -m coverage report --fail-under=95

lint: $(LINT_STAMP)
	$(BIN)/python -m ruff check .
	$(BIN)/python -m mypy
	$(BIN)/python -m pytest -q test/test_ament_lint.py

audit:
	test -x $(AUDIT_VENV)/bin/python || $(PYTHON) -m venv $(AUDIT_VENV)
	$(AUDIT_VENV)/bin/python -m pip --disable-pip-version-check install --quiet pip-audit==2.10.1
	$(AUDIT_VENV)/bin/pip-audit --no-deps --disable-pip \
		$(foreach lock,runtime ros dev ament lint,-r requirements/$(lock).txt)

bench: $(TEST_STAMP) $(CONTRIB_VENV)/.installed
	$(BIN)/python benchmarks/speed.py --contrib-python $(CONTRIB_VENV)/bin/python \
		--plot docs/speed.svg
	$(BIN)/python benchmarks/against_filters.py --contrib-python $(CONTRIB_VENV)/bin/python

bench-live: $(TEST_STAMP)
	$(BIN)/python benchmarks/live.py

SOAK_SECONDS ?= 1800
soak: $(TEST_STAMP)
	$(BIN)/python reliability/soak.py --seconds $(SOAK_SECONDS)

fuzz: $(TEST_STAMP)
	$(BIN)/python reliability/fuzz.py

bench-two-hosts: $(TEST_STAMP)
	$(BIN)/python reliability/two_hosts.py

tables: $(RUN_STAMP)
	$(BIN)/python scripts/parameter_table.py --write

$(BIN)/python:
	$(PYTHON) -m venv $(if $(ROS),--system-site-packages) $(VENV)

$(RUN_STAMP): requirements/build.txt $(RUN_LOCKS) setup.py package.xml pyproject.toml | $(BIN)/python
	@echo 'Installing into $(VENV) ($(if $(ROS),with ROS 2 $(ROS_DISTRO) as sourced,with ROS 2 Jazzy from PyPI)); the first time takes a minute'
	$(PIP) -r requirements/build.txt
	$(PIP) --no-build-isolation $(RUN_LOCKS:%=-r %)
	$(PIP) --no-build-isolation --editable .
	@touch $@

$(TEST_STAMP): $(TEST_LOCKS) $(RUN_STAMP)
	$(if $(strip $(TEST_LOCKS)),$(PIP) --no-build-isolation --no-compile $(TEST_LOCKS:%=-r %))
	@touch $@

$(LINT_STAMP): requirements/lint.txt $(TEST_STAMP)
	$(PIP) -r requirements/lint.txt
	@touch $@

$(CONTRIB_VENV)/.installed: requirements/contrib.txt
	test -x $(CONTRIB_VENV)/bin/python || $(PYTHON) -m venv $(CONTRIB_VENV)
	$(CONTRIB_VENV)/bin/python $(PIP_INSTALL) --only-binary :all: -r $<
	@touch $@

$(OLDEST_VENV)/.installed: requirements/oldest.txt requirements/build.txt setup.py package.xml
	test -x $(OLDEST_VENV)/bin/python || $(OLDEST_PYTHON) -m venv $(OLDEST_VENV)
	$(OLDEST_PIP) -r requirements/build.txt
	$(OLDEST_PIP) --no-build-isolation -r $<
	$(OLDEST_PIP) --no-build-isolation --editable .
	@touch $@

UV ?= uv
COMPILE := $(UV) pip compile --quiet --universal --python-version 3.10 --generate-hashes \
	--no-header --no-annotate --upgrade
lock:
	$(COMPILE) requirements/build.in -o requirements/build.txt
	$(COMPILE) requirements/runtime.in -c requirements/build.txt -o requirements/runtime.txt
	$(COMPILE) requirements/ros.in -c requirements/build.txt -c requirements/runtime.txt -o requirements/ros.txt
	$(COMPILE) requirements/dev.in -c requirements/runtime.txt -c requirements/ros.txt -o requirements/dev.txt
	$(COMPILE) requirements/ament.in -c requirements/build.txt -c requirements/ros.txt -c requirements/dev.txt -o requirements/ament.txt
	$(COMPILE) requirements/lint.in -c requirements/dev.txt -o requirements/lint.txt
	$(COMPILE) requirements/oldest.in -c requirements/build.txt -o requirements/oldest.txt
	$(COMPILE) requirements/contrib.in -o requirements/contrib.txt

clean:
	rm -rf $(VENV) $(CONTRIB_VENV) $(OLDEST_VENV) $(AUDIT_VENV) build install log demo_output *.egg-info \
		.pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage*
