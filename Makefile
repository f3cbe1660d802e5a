# Works from any folder: `make`, `make -C path`, `make -f path/Makefile`. `make help` lists the targets.

# make takes a space in a name for the end of it.
ifneq ($(words $(MAKEFILE_LIST) $(CURDIR)),2)
$(error The path of this folder has a space, with which make cannot work: move it, or run `pip install .` in an environment)
endif

ROOT := $(patsubst %/,%,$(dir $(abspath $(lastword $(MAKEFILE_LIST)))))
VENV := $(ROOT)/.venv
PY := $(VENV)/bin/python
PYTHON ?= $(shell command -v python3.11 || command -v python3)
EXTRAS := dev,docs,gymnasium,pandas,ray,bench,video
RUN := runs/circle_lwr4plus/vprnn-seed0
# Each process of the tests begins at its own half and takes from the other's end when it is through: so tests of one
# file, which share what they make first, and the kernels that they compile, stay together.
TWO_AT_ONCE := -n 2 --dist worksteal

# What is installed follows from these; a stamp named after them says that pip has nothing to do.
STATE := $(shell { echo '$(ROOT)'; cat '$(ROOT)/pyproject.toml' '$(ROOT)/constraints.txt'; } | cksum | tr ' ' '-')
INSTALLED := $(VENV)/.surgsim-$(STATE)
INSTALLED_DEV := $(VENV)/.surgsim-dev-$(STATE)
INSTALLED_DOCS := $(VENV)/.surgsim-docs-$(STATE)
INSTALLED_ALL := $(VENV)/.surgsim-all-$(STATE)
# Python compiles a module when it is first imported; pip would compile all of them, which takes as long as the rest.
BY_PIP := -m pip install --disable-pip-version-check --no-compile -c "$(ROOT)/constraints.txt"
PIP_INSTALL := "$(PY)" $(BY_PIP)
# uv installs in seconds what takes pip most of a minute. The pip of $(PYTHON), or one that the environment is given where
# that has none, puts it beside the environment for as long as it is needed. It asks the index that pip is configured for.
# Where there is no uv to be had, or it does not get through, pip does it all.
FAST := $(VENV)/.uv
NO_PIP := no pip: install that of your system, often called python3-pip or python3-venv
OWN_PIP := { "$(PY)" -c 'import pip' 2> /dev/null || "$(PY)" -m ensurepip || { echo '$(NO_PIP)'; exit 1; }; }
FIND_PIP := PIP='$(PYTHON)'; "$$PIP" -c 'import pip' 2> /dev/null || { $(OWN_PIP); PIP='$(PY)'; };
GET_FAST := PIP_ROOT_USER_ACTION=ignore PIP_REQUIRE_VIRTUALENV=0 "$$PIP" $(BY_PIP) --quiet --upgrade --target '$(FAST)' uv
INDEX_OF_PIP := "$$PIP" -m pip config list 2> /dev/null | sed -nE "s/^(global|install|:env:)\.index-url='(.*)'$$/\2/p" | head -n 1
BY_FAST := UV_SYSTEM_CERTS=1 "$(FAST)/bin/uv" pip install --no-config --python "$(PY)" $${INDEX:+--default-index "$$INDEX"} -c "$(ROOT)/constraints.txt"
# Both say nothing while they unpack, uv outside a terminal not while it downloads: every ten seconds a line tells how much is there.
ALIVE := began=$$(date +%s); { while sleep 10 > /dev/null 2>&1; do printf '  installing for %s s, %s MB so far\n' "$$(($$(date +%s) - began))" "$$(du -sm '$(VENV)' | cut -f1)" >&2; done; } & trap "kill $$! 2> /dev/null" EXIT;
OLD_ENOUGH := import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else "surgsim needs Python 3.11 or newer; %s is %d.%d. Set PYTHON=/path/to/python3.11" % (sys.executable, v[0], v[1]))

# Containers often set this; every process would then compile all sources again, which takes longer than most commands.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help install install-dev install-all run test test-all check bench pictures docs wheel clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*  ## \(.*\)/\1|\2/p' '$(ROOT)/Makefile' | awk -F'|' '{ printf "%-12s %s\n", $$1, $$2 }'

install: $(INSTALLED)  ## create .venv and install surgsim in it (editable)

install-dev: $(INSTALLED_DEV)  ## the same with the tools of tests and checks

install-all: $(INSTALLED_ALL)  ## the same with every extra, as CI has it

run: $(INSTALLED)  ## run the circle scenario, then inspect its recording
	@cd '$(ROOT)' && "$(PY)" -m surgsim run circle_lwr4plus --out '$(RUN)'
	@echo
	@cd '$(ROOT)' && "$(PY)" -m surgsim inspect '$(RUN)'
	@echo && echo 'written to $(ROOT)/$(RUN):' && ls -l '$(ROOT)/$(RUN)'

test: $(INSTALLED_DEV)  ## run the tests, slow ones left out; PYTEST_ARGS=... are given to pytest
	@cd '$(ROOT)' && "$(PY)" -m pytest $(TWO_AT_ONCE) -m "not slow" $(PYTEST_ARGS)

test-all: $(INSTALLED_DEV)  ## run all tests
	@cd '$(ROOT)' && "$(PY)" -m pytest $(TWO_AT_ONCE) $(PYTEST_ARGS)

check: $(INSTALLED_DEV)  ## formatting, lint and types, as CI
	@cd '$(ROOT)' && "$(PY)" -m ruff format --check .
	@cd '$(ROOT)' && "$(PY)" -m ruff check .
	@cd '$(ROOT)' && "$(PY)" -m ruff check --preview --select PLW1514 .
	@cd '$(ROOT)' && "$(PY)" -m mypy

bench: $(INSTALLED)  ## measure the speed on this machine
	@cd '$(ROOT)' && "$(PY)" -m surgsim bench

pictures: $(INSTALLED_DEV)  ## make pictures, tables and leaderboard pages of the documents again; needs OpenGL, and Vulkan for the viewer
	@cd '$(ROOT)' && "$(PY)" docs/images/draw.py && "$(PY)" docs/images/viewer.py

docs: $(INSTALLED_DOCS)  ## build the documentation site into build/site; a warning is an error
	@cd '$(ROOT)' && "$(PY)" -m sphinx --quiet --fail-on-warning --keep-going --conf-dir docs . build/site
	@echo 'open $(ROOT)/build/site/index.html'

wheel: $(INSTALLED_DEV)  ## build the wheels into dist/: surgsim, and surgsim-core with fewer dependencies
	@cd '$(ROOT)' && "$(PY)" -m pip wheel --quiet --no-build-isolation --no-deps --wheel-dir dist . ./core
	@ls -l '$(ROOT)'/dist/*.whl

clean:  ## remove build products and caches; .venv and runs stay
	@cd '$(ROOT)' && rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find '$(ROOT)/surgsim' '$(ROOT)/tests' -name __pycache__ -type d -prune -exec rm -rf {} +

# $(call install,REQUIREMENT). The build tools come first, so that they too follow constraints.txt.
define install
	@"$(PY)" -c '$(OLD_ENOUGH)'
	@echo 'installing surgsim into $(VENV): about 1.5 GB' >&2
	@exec >&2; $(ALIVE) $(FIND_PIP) { $(GET_FAST) && INDEX=$$($(INDEX_OF_PIP)) && $(BY_FAST) --quiet pip hatchling editables && $(BY_FAST) --no-build-isolation -e '$(1)'; } \
	|| { echo 'not by uv: pip installs, which takes longer'; $(OWN_PIP); $(PIP_INSTALL) --quiet hatchling editables && $(PIP_INSTALL) --no-build-isolation -e '$(1)'; }
	@rm -rf '$(FAST)'
	@rm -f '$(VENV)'/.surgsim-*
endef

$(INSTALLED): | $(PY)
	$(call install,$(ROOT))
	@touch '$(INSTALLED)'

$(INSTALLED_DEV): | $(PY)
	$(call install,$(ROOT)[dev])
	@touch '$(INSTALLED)' '$(INSTALLED_DEV)'

$(INSTALLED_DOCS): | $(PY)
	$(call install,$(ROOT)[docs])
	@touch '$(INSTALLED)' '$(INSTALLED_DOCS)'

$(INSTALLED_ALL): | $(PY)
	$(call install,$(ROOT)[$(EXTRAS)])
	@touch '$(INSTALLED)' '$(INSTALLED_DEV)' '$(INSTALLED_DOCS)' '$(INSTALLED_ALL)'

$(PY):
	@test -n '$(PYTHON)' || { echo 'surgsim needs Python 3.11 or newer, and none was found. Set PYTHON=/path/to/python3.11' >&2; exit 1; }
	@"$(PYTHON)" -c '' || { echo 'surgsim needs Python 3.11 or newer, and $(PYTHON) does not run. Set PYTHON=/path/to/python3.11' >&2; exit 1; }
	@"$(PYTHON)" -c '$(OLD_ENOUGH)'
	@"$(PYTHON)" -m venv --without-pip '$(VENV)'
