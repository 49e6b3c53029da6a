# make check = what CI runs = the README's test command. Everything it needs is installed by it.
PYTHON ?= python3
VENV   ?= .venv
BIN     = $(VENV)/bin
JOBS   ?= 2

.PHONY: check lint types imports test docs pictures golden firmware bench fuzz soak clean

check: lint types imports test

$(VENV)/.installed: pyproject.toml tools/install-system
	tools/install-system
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	touch $@

tests/e2e/node_modules/.installed: tests/e2e/package.json tests/e2e/package-lock.json
	cd tests/e2e && npm ci --silent --no-audit --no-fund
	touch $@

lint: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/python -m tools.check_c_operations

types: $(VENV)/.installed
	$(BIN)/mypy

imports: $(VENV)/.installed
	$(BIN)/lint-imports

test: $(VENV)/.installed tests/e2e/node_modules/.installed
	$(BIN)/python -m pytest -n $(JOBS) --durations=10

# The site, in build/docs: open build/docs/index.html
docs: $(VENV)/.installed
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --fresh-env --write-all --doctree-dir build/doctrees docs build/docs

# The documents' pictures, of runs that it makes: some minutes, and a Chromium for those of the report.
pictures: $(VENV)/.installed
	$(BIN)/python -m tools.pictures

golden: $(VENV)/.installed
	$(BIN)/python -m tools.make_vectors
	$(BIN)/python -m tools.spec_tables --write

# The C side of what Python says, and the images that ship: after an edit of firmware/ or of a table it is made from.
firmware: $(VENV)/.installed
	$(BIN)/python -m tools.firmware_headers --write
	$(BIN)/python -m tools.firmware_image --write

bench: $(VENV)/.installed
	$(BIN)/sil bench

# Not part of check: ten minutes for each of eight targets; and 24 simulated hours.
fuzz: $(VENV)/.installed
	$(BIN)/python -m tools.fuzz

soak: $(VENV)/.installed
	$(BIN)/python -m tools.soak

clean:
	rm -rf $(VENV) build dist *.egg-info tests/e2e/node_modules
