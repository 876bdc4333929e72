# Two commands do everything: `make demo`, `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DEMO_STAMP := $(VENV)/.installed-demo

# Python keeps the bytecode of what it reads: the tests start some hundred programs.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup demo docs picture test explore check lint types contract bounds benchmark deploy rollback arm64 clean

# Kernels are compiled here, with a word about it, and again only when they change.
setup: $(STAMP)
	@$(BIN)/glider compile

# pip runs again only when the dependencies change. $(call install,EXTRA)
define install
@$(PYTHON) -c 'import sys; sys.exit("glider needs Python 3.11 or newer, this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None'
@echo 'Installing into $(VENV), then compiling kernels: 1 to 6 minutes, the first time alone'
@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
$(BIN)/python -m pip install --disable-pip-version-check --constraint constraints.txt --editable '.[$(1)]'
@touch $@
endef

$(STAMP): pyproject.toml constraints.txt
	$(call install,dev)

# The demo needs a part of that, and compiles its own kernels on the way.
$(DEMO_STAMP): pyproject.toml constraints.txt
	$(call install,analysis)

demo: $(DEMO_STAMP)
	@$(BIN)/python -m glider.tools.verify.demo

# README's picture, of the demo's answer. A test fails where the demo has another answer than the picture.
picture: demo
	$(BIN)/python docs/picture.py out/demo/diagnosis docs/pictures/diagnosis.png

# Kernels that several test files share, once. Then two processes that compute, and two for the tests that wait for the
# clock (tests/conftest.py).
test: setup
	@$(BIN)/python -m tests.support.precompile
	$(BIN)/python -m pytest -n 4 --dist loadfile --no-loadscope-reorder

# Property tests with ten times the examples, others in every run; what fails is printed as a line to reproduce it by.
explore: setup
	@$(BIN)/python -m tests.support.precompile
	$(BIN)/python -m pytest -n 4 --dist loadfile -m hypothesis --hypothesis-profile explore

# The site of the documentation, in out/docs; a warning is an error, and so is a link within it that leads nowhere.
docs: $(STAMP)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs out/docs
	@$(BIN)/python docs/links.py out/docs
	@echo 'site: out/docs/index.html'

check: setup lint types contract docs test

lint: $(STAMP)
	$(BIN)/ruff check .

types: $(STAMP)
	$(BIN)/mypy

contract: $(STAMP)
	$(BIN)/lint-imports

# The lowest versions that pyproject.toml promises, and the newest Python and versions: a quarter of an hour each.
bounds:
	.ci/bounds lowest python3.11
	.ci/bounds newest python3.13

benchmark: setup
	$(BIN)/glider benchmark

# HOST: where ssh reaches the glider's computer. What is committed is installed there beside what flies, checked, and
# switched to; `rollback` goes back to the release before.
deploy: $(STAMP)
	@test -n "$(HOST)" || { echo 'make deploy HOST=user@glider' >&2; exit 2; }
	$(BIN)/python -m glider.tools.deploy.push $(HOST)

rollback: $(STAMP)
	@test -n "$(HOST)" || { echo 'make rollback HOST=user@glider' >&2; exit 2; }
	$(BIN)/python -m glider.tools.deploy.push $(HOST) --rollback

# A release on an emulated 64-bit ARM computer: installed from its wheels, flown, compared. Root; a quarter of an hour.
# QUICK=1: as plain Python all through, some four minutes; CI runs it.
# Outside this folder: /proc and /dev are mounted in it while it runs, and pip and `clean` walk through all that lies here.
ARM64 ?= /var/tmp/glider-arm64
arm64: $(STAMP)
	$(BIN)/python -m glider.tools.verify.arm64.emulated $(ARM64) $(if $(QUICK),--quick)

clean:
	rm -rf --one-file-system $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
