# Thin aliases; the work is in tools/setup.py (fresh machine to ready) and in `metaros` itself.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11 python; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo $$p; break; }; done)
BIN = .venv/bin
# A machine that forbids bytecode compiles every module again in each of a thousand processes.
unexport PYTHONDONTWRITEBYTECODE
# Tests wait for the disk and for other processes a quarter of their time: one worker more than CI has cores.
WORKERS ?= 3
# Tests that share a fixture stay together, and all begin in the order of tests/conftest.py.
SHARED = --dist loadgroup --no-loadscope-reorder
# CI runs the integration tests too; at a desk they are one word away: make test ALL=1
MARKERS = $(if $(or $(CI),$(ALL)),,-m "not integration")

.PHONY: setup up test conformance profile check fmt proto lock bench bench-anomaly bench-faults campaign clean

setup:
	@[ -n "$(PYTHON)" ] || { echo "metaros: needs Python 3.11 or newer (Debian: apt install python3)"; exit 1; }
	@$(PYTHON) tools/setup.py

up: setup
	@$(BIN)/metaros up $(ARGS)

test: setup
ifdef CHANGED
	@$(BIN)/python tools/changed_tests.py -n $(WORKERS) -m "not integration" $(ARGS)
else
	@$(BIN)/python -m pytest -n $(WORKERS) $(SHARED) $(MARKERS) $(ARGS)
endif

# What is on the wire, with peers that know no Meta-ROS; with a real ROS 2, too: make conformance ROS=/opt/ros/jazzy
ROS ?=
conformance: setup
	@METAROS_CONFORMANCE=1 METAROS_ROS="$(ROS)" $(BIN)/python -m pytest -q -n 0 tests/ros2 $(ARGS)

profile: setup
	@$(BIN)/python tools/profile_tests.py -n $(WORKERS) $(SHARED) $(MARKERS) $(ARGS)

check: setup
	@$(BIN)/python tools/check.py

fmt: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

proto: setup
	$(BIN)/python tools/gen_proto.py
	$(BIN)/python tools/gen_interfaces.py
	$(BIN)/python tools/gen_drivers.py
	$(BIN)/python tools/gen_ts_client.py

lock:
	$(BIN)/uv pip compile --universal --all-extras --generate-hashes --no-emit-index-url --no-annotate --no-header \
		--python-version 3.11 --upgrade -q pyproject.toml -o requirements.lock

bench: setup
	@$(BIN)/python -m load_tests $(ARGS)

# The detectors on the development series of NAB, or on any folder of such files: make bench-anomaly DIR=folder
bench-anomaly: setup
	@$(BIN)/python -m load_tests.anomaly $(or $(ARGS),nab $(DIR) --cross-validate)

# Faults injected into simulated robots, and days of healthy ones: some minutes; ARGS="--quick" for a glance
bench-faults: setup
	@OPENBLAS_NUM_THREADS=1 $(BIN)/python -m load_tests.anomaly faults $(ARGS)

campaign: setup
	@$(BIN)/python -m load_tests.campaigns $(ARGS)

clean:
	rm -rf .venv .make build dist gateway/static dashboard/node_modules dashboard/dist \
		.pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
