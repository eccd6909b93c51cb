# Helideck's commands. `make land` and `make test` set up first; the set-up is quick the second time.
#   make setup   the environment .venv with everything, and Mesa's EGL where no OpenGL is there
#   make land    flies the default landing (ARGS="--seed 3 --json" is handed on)
#   make test    the tests (ARGS="-k altitude" is handed on; ARGS="-m slow" runs the long ones)
#   make check   ruff and mypy
#   make clean   removes the environment and all caches; flights stay
# PYTHON=/its/path chooses the Python.

.DEFAULT_GOAL := help
.PHONY: help setup egl land test check clean
VENV := .venv
PACKAGES := $(VENV)/.packages
STAMP := $(VENV)/.installed
PIP := $(VENV)/bin/python -m pip --disable-pip-version-check install --quiet --no-deps

help:
	@sed -n 's/^#   //p' Makefile

setup: $(STAMP) egl

# Stamps are written last: what was broken off starts again.
$(PACKAGES): requirements.lock
	@python=$$(tools/find-python) && rm -rf $(VENV) && \
	echo "helideck: making $(VENV) with $$($$python -V), $$(grep -c == requirements.lock) packages (about a minute)" && \
	$$python -m venv $(VENV)
	@$(PIP) --only-binary :all: --no-compile -r requirements.lock
	@touch $@

$(STAMP): $(PACKAGES) pyproject.toml
	@$(PIP) --no-build-isolation -e .
	@touch $@

egl: $(STAMP)
	@tools/install-egl $(VENV)/bin/python

land: setup
	@$(VENV)/bin/helideck land $(ARGS)

test: setup
	@$(VENV)/bin/python -m pytest $(ARGS)

check: $(STAMP)
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/mypy

clean:
	rm -rf $(VENV) .mypy_cache .pytest_cache .ruff_cache .hypothesis build dist
	find . -name __pycache__ -type d -not -path './.git/*' -exec rm -rf {} +
