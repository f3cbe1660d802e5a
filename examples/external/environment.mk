# `make -C examples/external/NAME`: its own environment in NAME/.venv, with the versions of NAME/requirements.txt.
HERE := $(patsubst %/,%,$(dir $(abspath $(firstword $(MAKEFILE_LIST)))))
VENV ?= $(HERE)/.venv
PYTHON ?= $(shell command -v python3.11 || command -v python3)

$(VENV)/installed: $(HERE)/requirements.txt
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check $(PIP_OPTIONS) -r $<
	touch $@

clean:
	rm -rf $(VENV)

.PHONY: clean
