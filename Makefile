# Every target sets up .venv by itself; `make help` lists them.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help setup locked lock demo examples docs test thorough quick lint chaos chaos-long fuzz conformance accuracy bench figures release clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 16

# Two stamps hold the environment: what the programs need, and with the developer's tools. Each is made again
# when pyproject.toml changes.
$(VENV)/.runtime: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

$(VENV)/.stamp: $(VENV)/.runtime
	$(BIN)/python -m pip install --quiet --editable '.[dev,fast]'
	@touch $@

locked: requirements-dev.txt  ## make .venv with the versions of requirements-dev.txt, checked by their hashes
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes --requirement requirements-dev.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $(VENV)/.runtime $(VENV)/.stamp

lock: $(VENV)/.runtime  ## write requirements-dev.txt anew from pyproject.toml
	$(BIN)/python -m pip install --quiet 'uv>=0.5'
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --extra dev --extra fast --output-file requirements-dev.txt pyproject.toml

setup: $(VENV)/.stamp  ## make .venv with everything the other targets need

demo: $(VENV)/.runtime  ## the whole path once: simulator, agent, localization.out, a table and a figure
	$(BIN)/python -m ciberrato demo

lint: $(VENV)/.stamp  ## ruff, codespell and mypy
	$(BIN)/codespell
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

quick: $(VENV)/.stamp  ## the tests that take less than a few seconds each
	$(BIN)/python -m pytest -n auto -m "not slow and not chaos_long"

test: lint  ## the tests, on every core, after ruff, codespell and mypy; CI runs `make thorough` on top
	$(BIN)/python -m pytest -n auto -m "not thorough and not chaos_long"

thorough: $(VENV)/.stamp  ## whole courses, other systems, bad neighbours, signals at many moments, all cases of motion; CI runs it, too
	$(BIN)/python -m pytest -n auto -m "thorough and not chaos_long"

chaos: $(VENV)/.stamp  ## bad networks, hostile clients, full disks: the part that CI runs, one test at a time
	$(BIN)/python -m pytest tests/chaos -m "not chaos_long"

chaos-long: $(VENV)/.stamp  ## all of that, and the table of faults, five tries each
	$(BIN)/python -m pytest tests/chaos
	$(BIN)/python -m tests.chaos.scenario --tries 5
	$(BIN)/python -m tests.chaos.soak --minutes 20
	$(BIN)/python -m tests.chaos.starvation --runs 100

fuzz: $(VENV)/.stamp  ## coverage-guided fuzzing of all readers, 10 minutes each, or SECONDS=..., READERS="lab overlay"
	$(BIN)/python -m pip install --quiet 'atheris>=3.0'
	$(BIN)/python -m tests.chaos.fuzz $(READERS) $(if $(SECONDS),--seconds $(SECONDS))

conformance: $(VENV)/.stamp  ## compare with recordings of the real simulator: the tests', or GOLDEN=... LABS=...
	$(BIN)/python -m benchmarks.conformance $(if $(GOLDEN),--golden '$(GOLDEN)') $(if $(LABS),--labs '$(LABS)')

accuracy: $(VENV)/.stamp  ## how often the most likely cell is the true one, both presets, 200 drives a lab
	$(BIN)/python -m benchmarks.accuracy

examples: $(VENV)/.stamp  ## the classic localization problems, with figures in build/figures
	$(BIN)/python -m examples all

bench: $(VENV)/.stamp  ## speed, as ratios to plain references; writes build/bench.json
	$(BIN)/python -m benchmarks

docs: $(VENV)/.stamp  ## the manual as a site, build/site/index.html; needs no network
	$(BIN)/python -m sphinx -W -q -b html -d build/trees docs build/site
	@echo build/site/index.html

release: $(VENV)/.stamp  ## wheel and source archive of the last commit into dist/, built twice and compared
	$(BIN)/python -m pip install --quiet --editable '.[release]'
	.ci/release

figures: $(VENV)/.stamp  ## the pictures of the manual, into docs/figures (the screenshots need Chromium)
	$(BIN)/python -m examples.agent_figures docs/figures
	$(BIN)/python -m examples.viewer_figures docs/figures
	$(BIN)/python -m examples.learn docs/figures

clean:  ## remove what the other targets made
	rm -rf $(VENV) build dist demo .mypy_cache .ruff_cache .pytest_cache .hypothesis
