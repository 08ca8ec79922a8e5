# Everything happens in a virtual environment of the project's own; both main goals set it up.
#   make run    an emulated robot learns and drives the curve
#   make test   style, types and tests
#   make test-long  whole sweeps of experiments, installations (minutes)
#   make bench  speed, as ratios (ten minutes)
#   make asv    the same for commits, kept and compared (three minutes a commit; COMMITS="HEAD~3..HEAD")
#   make hostile  bad inputs at every edge, forty times as many as in make test (minutes)
#   make soak   long use of the serial line (ten minutes)
#   make soak-service     ten hours of service under random faults and restarts, a hundred times faster
#   make soak-watchers    an hour of eight robots and all who watch them, five times faster
#   make pyserial-suite   pySerial's own tests on the emulator's terminal (half a minute)
#   make faults           a live run and what may befall it (twenty minutes)
#   make viewer           Foxglove Studio for its tests, in tests/viewer/node_modules (npm, 36 MB)
#   make docs             the documentation site, in build/site/VERSION (a few minutes)
#   make man              man pages of both programs and their commands, in build/man
#   make dist             source distribution and wheel, built and checked, in dist
#   make pythons          the wheel on every CPython that is found, in environments of their own (minutes)
#   make workflows        the forge's workflow files and forms, checked
#   make stop-times       how long the robot rolls on when it must stop (an hour)

# The first of these that runs and is new enough: a name alone may lead nowhere.
ifndef PYTHON
PYTHON := $(shell for each in python3.11 python3.12 python3.13 python3.14 python3 python; do \
	"$$each" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>&- && echo "$$each" && break; done)
endif
VENV := .venv
SCRIPTS := $(if $(filter Windows_NT,$(OS)),Scripts,bin)
BIN := $(VENV)/$(SCRIPTS)
READY := $(VENV)/ready
# Sphinx and its themes are of no use to those who run or test: an environment of their own.
RELEASE_VENV := .venv-release
RELEASE_BIN := $(RELEASE_VENV)/$(SCRIPTS)
RELEASE_READY := $(RELEASE_VENV)/ready

# Commits that asv measures.
COMMITS ?= HEAD^!

# The site of a release is a folder of its own; others stay beside it.
VERSION ?= $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
SITE ?= build/site

.PHONY: run test test-long style lint hostile bench asv soak soak-service soak-watchers pyserial-suite faults stop-times viewer docs man dist pythons workflows lock clean
.DELETE_ON_ERROR:

run: $(READY)
	$(BIN)/macor-hil demo

# types are checked beside the first tests: both take one processor at times
test: style
	$(BIN)/mypy & types=$$!; \
		$(BIN)/python -m pytest -n 4 --dist worksteal -m "not wall_clock and not long" && wait $$types
	$(BIN)/python -m pytest -n 3 -m "wall_clock and not long"

test-long: $(READY)
	$(BIN)/python -m pytest -n 4 --dist worksteal -m long

hostile: $(READY)
	HOSTILE_LONG=1 $(BIN)/python -m pytest -n 4 --dist worksteal tests/hostile

style: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

lint: style
	$(BIN)/mypy

bench: $(READY)
	$(BIN)/python benchmarks/run.py
	$(BIN)/python benchmarks/peers.py
	$(BIN)/python benchmarks/service.py

asv: $(RELEASE_READY)
	$(RELEASE_BIN)/asv machine --yes --config benchmarks/asv.conf.json
	$(RELEASE_BIN)/asv run --config benchmarks/asv.conf.json --show-stderr $(COMMITS)
	$(RELEASE_BIN)/asv publish --config benchmarks/asv.conf.json

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

soak-watchers: $(READY)
	PYTHONPATH=tests $(BIN)/python benchmarks/soak_watchers.py

viewer:
	cd tests/viewer && npm ci --no-audit --no-fund

docs: $(RELEASE_READY)
	rm -rf $(SITE)/$(VERSION)
	$(RELEASE_BIN)/sphinx-build --quiet --fail-on-warning --keep-going --jobs auto -c docs/site \
		-d build/doctrees -D version=$(VERSION) -D release=$(VERSION) docs $(SITE)/$(VERSION)

man: $(READY)
	$(BIN)/python docs/man.py build/man

dist: $(RELEASE_READY)
	rm -rf dist
	$(RELEASE_BIN)/python -m build --outdir dist
	$(RELEASE_BIN)/twine check --strict dist/*

pythons: $(READY)
	PYTHONPATH=tests $(BIN)/python benchmarks/pythons.py

workflows: $(RELEASE_READY)
	$(RELEASE_BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(RELEASE_BIN)/check-jsonschema --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/[!c]*.yml
	$(RELEASE_BIN)/check-jsonschema --builtin-schema vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
	$(RELEASE_BIN)/check-jsonschema --builtin-schema vendor.citation-file-format CITATION.cff
	$(RELEASE_BIN)/check-jsonschema --builtin-schema vendor.dependabot .github/dependabot.yml
	$(RELEASE_BIN)/zizmor --offline --quiet .github

$(READY): requirements.lock pyproject.toml
	@$(or $(PYTHON),false) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "CPython 3.11 or newer is needed; name one with: make PYTHON=/path/to/python3.11"; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps -e .
	touch $@

$(RELEASE_READY): requirements-release.lock pyproject.toml
	test -x $(RELEASE_BIN)/python || $(PYTHON) -m venv $(RELEASE_VENV)
	$(RELEASE_BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-release.lock
	$(RELEASE_BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps -e .
	touch $@

# Every extra but that of the benchmarks, whose peer is heavy and optional.
EXTRAS = import tomllib; \
	extras = tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]; \
	print(*(f"--extra={extra}" for extra in extras if extra not in ("benchmarks", "docs", "peers", "release", "tracking")))

# Pin the newest versions that pyproject.toml admits (needs uv, which is not installed otherwise).
lock: $(READY)
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile pyproject.toml $$($(BIN)/python -c '$(EXTRAS)') \
		--universal --python-version 3.11 \
		--generate-hashes --no-header --no-annotate --upgrade --quiet -o requirements.lock
	$(BIN)/uv pip compile pyproject.toml --extra=build --extra=docs --extra=release --extra=tracking \
		--universal --python-version 3.11 \
		--generate-hashes --no-header --no-annotate --upgrade --quiet -o requirements-release.lock

clean:
	rm -rf $(VENV) $(RELEASE_VENV) runs build *.egg-info
