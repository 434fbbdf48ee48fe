# Svev. `make demo` and `make test` set up everything that they need on a fresh Debian 12, the first time
# (`make demo` on Debian 13 too).
# ARGS is passed to the program that the target runs:  make test ARGS="tests/rig -x"   make demo ARGS="--seconds 5"

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
.PHONY: help demo run bench corpus test test-long check style wheel lowest bundle install rollback uninstall lock tools client-tool readers docs clean setup system

# Some environments forbid Python to keep what it compiled: then each of the thousands of processes of the tests, and each
# call of pytest, would compile the program anew.
unexport PYTHONDONTWRITEBYTECODE

# Tests that run at a time. Many wait for cameras, browsers and clocks: three keep two cores busy.
WORKERS ?= 3

ARGS ?=
PREFIX ?= /usr/local
BIN := .venv/bin
# pip shows only errors (-qq), and installs only locked versions with hashes.
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input
VENV := .venv/.setup-venv
LOCKED := .venv/.setup-locked
SVEV := .venv/.setup-svev
DOCS := build/docs/env/.setup-docs
NPM := $(patsubst %/package-lock.json,%/node_modules/.setup-npm,$(wildcard tests/*/npm/package-lock.json))

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-11s %s\n", $$1, $$2 }' Makefile

demo: setup ## the main job on the simulated hill: three GigE Vision cameras, one jump, a log and a contact sheet
	@$(BIN)/svev demo $(ARGS)

run: setup ## the service on the simulated hill, with its panel at http://127.0.0.1:8000/
	@$(BIN)/svev serve --rig config/rigs/sim-gige.toml $(ARGS)

bench: setup ## the benchmarks, side by side with GStreamer
	@$(BIN)/svev bench $(ARGS)

corpus: setup ## the analysis on hills drawn at random, beside the truth and the run before (docs/explanation/corpus.md)
	@$(BIN)/python -m bench.corpus $(ARGS)

test: setup $(NPM) ## all tests but the long ones
	@tests/run $(WORKERS) "not long" $(ARGS)

# Those marked `alone` wait for a program of one thread that everybody comes before: on two cores there is room for two.
test-long: setup $(NPM) ## the tests that take long by nature: soak, every fault, statistics of sigmas, packaging
	@tests/run $(WORKERS) "long and not alone" -o timeout=400 $(ARGS)
	@tests/run 2 "long and alone" $(ARGS)

check: style test ## format, lint, types, layers, tests; CI tries the wheel and runs the long tests as well

# `nice`, since in CI it runs beside the tests, whose simulated cameras keep time.
style: setup
	@$(BIN)/ruff format --check --quiet . || { echo "format: run .venv/bin/ruff format ." >&2; exit 1; }
	@$(BIN)/ruff check --quiet .
	@nice $(BIN)/mypy
	@nice $(BIN)/lint-imports

wheel: setup ## build a wheel and try it in an empty environment outside the checkout
	@.ci/try-wheel

lowest: system ## the demo with the lowest versions of all packages that pyproject.toml names; newest ones for Python 3.11 to 3.14
	@.ci/try-versions

bundle: setup ## an archive in dist/, from which a computer without network, compiler or checkout installs Svev
	@systemd/archive dist

install: setup ## the program and its systemd service, into PREFIX (as root: /usr/local), beside the version that runs
	@systemd/install "$(PREFIX)"

rollback: ## go back to the version before
	@systemd/rollback "$(PREFIX)"

uninstall: ## remove all versions from PREFIX; keep configuration and recordings
	@systemd/uninstall "$(PREFIX)"

lock: ## choose the newest allowed versions again: make lock ARGS=--upgrade
	@.ci/get-uv
	@build/uv/bin/uv pip compile pyproject.toml --group dev --python-version 3.11 --quiet --generate-hashes \
	  --no-emit-index-url --no-header --no-annotate --output-file requirements.lock $(ARGS)
	@build/uv/bin/uv pip compile .ci/docs/requirements.in --python-version 3.11 --quiet --generate-hashes \
	  --no-emit-index-url --no-header --no-annotate --output-file .ci/docs/requirements.lock $(ARGS)

tools: setup $(NPM) $(DOCS) client-tool readers ## all that CI fetches from the network, best at the same time (-j4)

client-tool: system ## for the test that makes a client of the REST API: openapi-python-client, in an environment of its own
	@test -x build/client-tool/bin/openapi-python-client || { /usr/bin/python3 -m venv build/client-tool && \
	  build/client-tool/bin/pip install -qq openapi-python-client; }

readers: setup ## for tests in which our files are read by the programs that they are for, beside Svev's environment
	@test -e build/readers/.with-opensim || { $(PIP) install -qq --no-deps --upgrade --target build/readers pycolmap==4.2.1 caliscope==0.11.8 \
	  Pose2Sim==0.10.49 anytree rtoml platformdirs matplotlib contourpy cycler fonttools kiwisolver packaging pyparsing \
	  duckdb==1.5.5 duckdb-extension-sqlite-scanner==1.5.5 opensim==4.6 && touch build/readers/.with-opensim; }

docs: setup $(DOCS) ## the documentation as a site in build/site, with search; a link that leads nowhere is an error
	@$(BIN)/python -m tests.support.rest_description build/docs/openapi.json
	@NO_MKDOCS_2_WARNING=1 build/docs/env/bin/mkdocs build --strict --config-file .ci/docs/mkdocs.yml
	@echo "open build/site/index.html"

clean: ## remove everything that make made; keep recordings
	rm -rf .venv .cache/tests build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	rm -rf tests/*/npm/node_modules
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Set-up. Each step makes a stamp file when it is done, so that an interrupted step is repeated.
setup: $(SVEV) ## the program in .venv, to look around: .venv/bin/svev --help

# Who only looks or installs needs neither compiler nor browser nor Node.
system:
	@.ci/system-packages $(if $(filter-out setup demo run bundle install docs,$(MAKECMDGOALS)),develop,run)

$(VENV): | system
	@echo "setting up .venv from the distribution's Python"
	@/usr/bin/python3 -m venv --clear --system-site-packages .venv
	@touch $@

$(LOCKED): requirements.lock $(VENV)
	@echo "installing the locked packages"
	@$(PIP) install -qq --require-hashes -r requirements.lock
	@touch $@

$(SVEV): pyproject.toml $(LOCKED) | system
	@$(PIP) install -qq --no-deps --no-build-isolation -e .
	@touch $@

# In an environment of its own: a site generator is no part of the program.
$(DOCS): .ci/docs/requirements.lock | system
	@echo "installing the site generator"
	@/usr/bin/python3 -m venv --clear build/docs/env
	@build/docs/env/bin/pip --disable-pip-version-check --no-input install -qq --require-hashes -r $<
	@touch $@

%/node_modules/.setup-npm: %/package-lock.json | system
	@echo "installing the npm packages of $(dir $<)"
	@npm ci --prefix $(dir $<) --no-audit --no-fund --loglevel=error
	@touch $@
