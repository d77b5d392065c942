# make run    the main job: real cycles, rule-based against MPC, tables and pictures in results/
# make test   style, types and tests, all but the longest
# make test-slow  the longest tests: every mutation, variant and documented study
# make fuzz   100,000 hostile inputs to the loaders of users' files
# make release-check  wheel and sdist, built and tried in clean environments of every Python here
# make sbom   licences of what is shipped and needed, in build/sbom.cdx.json
# make history        the benchmark history, extended by this commit
# make docs   the documentation as a site, in build/site
# make clean  remove everything these made
# All but release-check first make the virtual environment .venv; a second time that is skipped.

PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed
PIP := $(BIN)/python -m pip --disable-pip-version-check

# mypy cannot follow the import hook of an editable install. It gets this tree of links instead,
# in which the mapped folders are where they are imported from.
TYPED := build/typed

.PHONY: run test test-slow fuzz lint types docs release-check sbom history venv clean

run: $(STAMP)
	$(BIN)/qpmpc compare nycc nedc-truncated --controllers rule-based,mh-qp-paper,mh-qp --out results

test: lint types
	$(BIN)/python -m pytest -m "not slow"

test-slow: $(STAMP)
	$(BIN)/python -m pytest -m slow

fuzz: $(STAMP)
	QPMPC_FUZZ=100000 $(BIN)/python -m pytest --dist=load tests/test_hostile_inputs.py

lint: $(STAMP)
	$(BIN)/ruff check .

types: $(STAMP)
	@rm -rf $(TYPED) && mkdir -p $(TYPED)/qpmpc
	@cd $(TYPED)/qpmpc && ln -s ../../../qpmpc/* ../../../codegen ../../../cycles ../../../verification .
	cd $(TYPED) && ../../$(BIN)/mypy --config-file ../../pyproject.toml --cache-dir ../../.mypy_cache -p qpmpc

docs: $(STAMP)
	$(BIN)/python docs/website/build.py build/site

release-check:
	$(PYTHON) .ci/release/check.py

sbom: $(STAMP)
	$(BIN)/python .ci/release/sbom.py build/sbom.cdx.json

history: $(STAMP)
	$(BIN)/python .ci/release/history.py

venv: $(STAMP)

# Debian's python3 without python3-venv has no ensurepip: then the system's pip fills the venv.
$(STAMP): requirements.lock pyproject.toml setup.py
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed: none found on PATH" >&2; exit 1; }
	@echo "Making $(VENV) with $(PYTHON): once, a few minutes"
	@test -x $(BIN)/pip || $(PYTHON) -m venv $(VENV) >/dev/null 2>&1 \
		|| { $(PYTHON) -m venv --clear --without-pip $(VENV) \
			&& $(PYTHON) -m pip --python $(BIN)/python install --quiet pip; } \
		|| { echo "$(PYTHON) can make no virtual environment: install python3-venv or pip" >&2; exit 1; }
	@$(PIP) install --quiet -r requirements.lock
	@PYTHONWARNINGS=ignore $(PIP) install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

clean:
	rm -rf $(VENV) build dist results .mypy_cache .pytest_cache .ruff_cache .hypothesis *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
