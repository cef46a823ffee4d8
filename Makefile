# `make demo` and `make test` set up everything they need in .venv, from Python 3.11 or newer.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python

.PHONY: demo test lint slow site clean

demo: $(VENV)/demo
	$(RUN) -m jflnr denoise jflnr/data/room.exr -o out/demo --png --reference --overwrite
	@echo "Look at out/demo/room.png (denoised); out/demo/room.exr holds the light itself."

test: $(VENV)/test lint
	$(RUN) -m pytest -m "not slow" -n auto --dist worksteal --durations=10

slow: $(VENV)/test
	$(RUN) -m pytest -m slow

lint: $(VENV)/test
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy

site: $(VENV)/test
	$(RUN) -m experiments pages
	NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/demo: pyproject.toml | $(VENV)/bin/python
	$(RUN) -m pip install --quiet --editable .
	@touch $@

$(VENV)/test: pyproject.toml | $(VENV)/bin/python
	$(RUN) -m pip install --quiet --editable '.[opencl,large,cluster,experiments,site,browser,dev]'
	@touch $@ $(VENV)/demo

clean:
	rm -rf $(VENV) out
