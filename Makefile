# Everything happens in a virtual environment of the project's own; both main goals set it up.
#   make run    an emulated robot learns and drives the curve
#   make test   style, types and tests
#   make bench  speed, as ratios (ten minutes)
#   make soak   long use of the serial line (ten minutes)
#   make soak-service     an hour of service under random faults, ten times faster
#   make pyserial-suite   pySerial's own tests on the emulator's terminal (half a minute)
#   make faults           a live run and what may befall it (twenty minutes)
#   make stop-times       how long the robot rolls on when it must stop (an hour)

PYTHON ?= $(firstword $(shell command -v python3.11 python3 python))
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready

.PHONY: run test lint bench soak soak-service pyserial-suite faults stop-times lock clean
.DELETE_ON_ERROR:

run: $(READY)
	$(BIN)/macor-hil demo

test: lint
	$(BIN)/python -m pytest -n 4 --dist worksteal -m "not wall_clock"
	$(BIN)/python -m pytest -n 3 -m wall_clock

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(READY)
	$(BIN)/python benchmarks/run.py
	$(BIN)/python benchmarks/service.py

soak: $(READY)
	PYTHONPATH=tests $(BIN)/python benchmarks/soak.py

pyserial-suite: $(READY)
	$(BIN)/python tests/pyserial_suite.py

faults: $(READY)
	PYTHONPATH=tests $(BIN)/python benchmarks/faults.py

stop-times: $(READY)
	PYTHONPATH=tests $(BIN)/python benchmarks/stop_times.py

soak-service: $(READY)
	PYTHONPATH=tests $(BIN)/python benchmarks/soak_service.py

# NumPy and setuptools come first: where there is no wheel of PyBullet (CPython above 3.11), pip
# builds it, and only with NumPy at hand it hands out pictures as arrays.
$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "CPython 3.11 or newer is needed; name one with: make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
		echo "CPython 3.11 is the reference; for this newer one PyBullet is built, which takes minutes."
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	sed -n '/^\(numpy\|setuptools\)==/,/[^\\]$$/p' requirements.lock > $(VENV)/first.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $(VENV)/first.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps -e .
	touch $@

# Every extra but that of the benchmarks, whose peer is heavy and optional.
EXTRAS = import tomllib; \
	extras = tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]; \
	print(*(f"--extra={extra}" for extra in extras if extra not in ("benchmarks", "peers")))

# Pin the newest versions that pyproject.toml admits (needs uv, which is not installed otherwise).
lock: $(READY)
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile pyproject.toml $$($(BIN)/python -c '$(EXTRAS)') \
		--universal --python-version 3.11 \
		--generate-hashes --no-header --no-annotate --upgrade --quiet -o requirements.lock

clean:
	rm -rf $(VENV) runs build *.egg-info
