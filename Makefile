# fronto: every target sets up what it needs in .venv by itself; a second run is instant.
SHELL := /bin/sh
.SHELLFLAGS := -ec
.DEFAULT_GOAL := help
.NOTPARALLEL:
.DELETE_ON_ERROR:
.PHONY: help demo test lint bench docs figures clean

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PEERS := $(VENV)-peers
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# What an editable install is made from: pip runs again only when one of these changes.
SOURCES := pyproject.toml constraints.txt hatch_build.py src/fronto/_version.py $(wildcard src/fronto/native/*.[ch])

# FRONTO_EXTRAS=train,... adds extras to what `make test` and `make lint` install.
comma := ,
empty :=
space := $(empty) $(empty)
DEV := $(subst $(space),$(comma),$(strip dev $(subst $(comma),$(space),$(FRONTO_EXTRAS))))

help: ## show this list
	@grep -E '^[a-z]+:.*## ' Makefile | sed -e 's/:.*## /\t/' | expand -t 8

demo: $(VENV)/.stamp-core ## rectify the example photos into out/demo
	@mkdir -p out/demo
	@$(BIN)/fronto rectify examples/hall.png examples/car.png --camera examples/camera.yaml -o out/demo
	@echo "Head-on views: out/demo/*.rectified.png; what was found: out/demo/*.overlay.png, *.json"

test: $(VENV)/.stamp-$(DEV) ## run the tests
	$(BIN)/python -m pytest

lint: $(VENV)/.stamp-$(DEV) ## check style, formatting and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/.stamp-vanishing $(PEERS)/.stamp ## measure accuracy and speed; writes the tables of README.md and docs
	$(BIN)/python benchmarks/run.py $(if $(QUICK),--quick)

docs: $(VENV)/.stamp-docs ## build the documentation into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "Open site/index.html"

figures: $(VENV)/.stamp-core ## draw the documents' pictures again (examples: tools/render_photoreal.py)
	$(BIN)/python tools/make_readme_figure.py docs/images/before_after.png
	$(BIN)/python tools/make_segment_figure.py docs/images/segmentation.png
	$(BIN)/python tools/make_outline_figure.py docs/images/outlines.png
	$(BIN)/python tools/make_steps_figure.py docs/images/steps.png

clean: ## remove everything that these targets have made
	rm -rf $(VENV) $(PEERS) out site build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	rm -f src/fronto/native/_kernels.*
	find src tests benchmarks tools -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/.stamp-venv:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "fronto needs Python 3.11 or newer, and $(PYTHON) is:" >&2; \
	  $(PYTHON) --version >&2 || :; \
	  echo "Install one, then: make $(MAKECMDGOALS) PYTHON=python3.11" >&2; exit 1; }
	@echo "Setting up $(VENV) (once) ..."
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "Python's venv module does not work: on Debian and Ubuntu install python3-venv" >&2; \
	  exit 1; }
	@touch $@

$(VENV)/.stamp-core: $(VENV)/.stamp-venv $(SOURCES)
	@echo "Installing fronto and its dependencies (once) ..."
	@$(PIP) install --editable .
	@touch $@

# The rest after the dash is a list of extras.
$(VENV)/.stamp-%: $(VENV)/.stamp-venv $(SOURCES)
	@echo "Installing fronto[$*] (once) ..."
	@$(PIP) install --constraint constraints.txt --editable '.[$*]'
	@touch $@

# It asks for a build of OpenCV with windows, and needs nothing that the one without has not.
$(VENV)/.stamp-vanishing: $(VENV)/.stamp-bench
	@$(PIP) install --no-deps lu-vp-detect==1.0.4 && touch $@ || \
	  echo "Not installed: vanishing points are not measured. Again: make $(MAKECMDGOALS)" >&2

# What benchmarks compare with, apart from fronto's own packages. Where it cannot be had (offline,
# say), the benchmark that needs it says so and the others run.
$(PEERS)/.stamp: benchmarks/peers/requirements.txt | $(VENV)/.stamp-venv
	@echo "Installing what benchmarks compare with into $(PEERS) (once) ..."
	@{ $(PYTHON) -m venv $(PEERS) && \
	  $(PEERS)/bin/python -m pip --disable-pip-version-check --quiet install --requirement $< && \
	  touch $@; } || { rm -rf $(PEERS); \
	  echo "Not installed: reading is not measured. Again: make $(MAKECMDGOALS)" >&2; }
