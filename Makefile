# The front door. `make help` lists the targets; every target installs what it needs first and is
# quick when it is there already.

PYTHON ?= python3
TARGET ?= native# where the drive runs in `make demo`: native or emulated
SEED ?= 1# what `make bench-diagnosis` draws its cases from: below 1000 for developing, above for reporting
PROBE ?= openocd# for `make flash`: openocd, st-flash or dfu-util
VENV := .venv
BIN := $(VENV)/bin
PYTEST_FLAGS ?= -n 2
C_FILES = $(shell git ls-files 'firmware/*.c' 'firmware/*.h' 'hil_tests/*.c' 'hil_tests/*.h' | grep -v 'drive/dictionary\.[ch]')

COMPILE = uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
    --no-annotate --no-emit-index-url --no-emit-find-links

.DEFAULT_GOAL := help
.PHONY: help demo demo-diagnosis test lint format firmware flash debug generate docs wheels transcripts bench bench-faults bench-diagnosis bench-applied bench-feel bench-calibration bench-data-gate bench-sensitivity lock clean
.PHONY: setup setup-firmware setup-baselines setup-browser native kernels

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-15s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: native $(if $(filter emulated,$(TARGET)),firmware) ## the main job on the simulated rig: configure, run the tunnel, record, compare, report
	$(BIN)/bowden demo --output build/demo --target $(TARGET)

demo-diagnosis: native $(if $(filter emulated,$(TARGET)),firmware) ## the loop closed: find what the model lacks, apply it, render the tunnel better
	$(BIN)/bowden demo-diagnosis --part both --output build/demo-diagnosis --target $(TARGET)

# Two at a time: the checks leave a core idle, on which the kernels are compiled that tests need.
test: setup setup-firmware setup-browser ## lint, prove the firmware integer-only, run every test
	$(MAKE) --no-print-directory -j2 kernels lint firmware native
	$(BIN)/pytest $(PYTEST_FLAGS)
	$(BIN)/pytest $(PYTEST_FLAGS) hil_tests/test_bench.py hil_tests/test_drive.py hil_tests/test_storage.py hil_tests/test_table_write.py hil_tests/test_compensation.py --target=emulated --require-target

lint: setup ## ruff, mypy strict, import contracts, word list, clang-format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m shared.dictionary --check
	$(BIN)/python -m tools.word_list
	$(BIN)/clang-format --dry-run --Werror $(C_FILES)

format: setup ## format Python and C in place
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	$(BIN)/clang-format -i $(C_FILES)

firmware: setup-firmware ## build the board's ELF; prove: no float, include rules, size, worst-case stack
	$(MAKE) --no-print-directory -C firmware proof elf BUILD=$(CURDIR)/build

flash: setup-firmware ## write the firmware to a board and verify it (PROBE=openocd|st-flash|dfu-util)
	$(MAKE) --no-print-directory -C firmware flash PROBE=$(PROBE) BUILD=$(CURDIR)/build

debug: setup-firmware ## gdb on a running board, through OpenOCD
	$(MAKE) --no-print-directory -C firmware debug BUILD=$(CURDIR)/build

kernels: setup # compiled and kept by numba
	$(BIN)/python -m tools.kernels

native: setup ## build the firmware as a shared library for this machine
	$(MAKE) --no-print-directory -C firmware native BUILD=$(CURDIR)/build

docs: native ## build the documentation site, with executed notebooks, into build/docs
	$(BIN)/sphinx-build -W --keep-going -q -b html docs build/docs

transcripts: native wheels ## write into the pages what their commands print (PAGES="first-hour new-user-wheels new-user-repository"); minutes
	$(BIN)/python -m tools.transcripts $(PAGES)

wheels: setup ## build dist/bowden-*.whl and dist/bowden_rig-*.whl (with the compiled firmware)
	rm -rf dist && $(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w dist ./host ./rig

generate: setup ## remake everything that comes from shared/object_dictionary.yaml
	$(BIN)/python -m shared.dictionary

bench: firmware native ## measure; results in build/bench.json
	$(BIN)/python -m hil_tests.benchmarks --output build/bench.json

bench-faults: firmware native ## every single fault in every situation, native and on the ELF; docs/fault-campaign.md; about an hour
	$(BIN)/python -m hil_tests.fault_campaign --jobs 2 --json build/faults.json --output docs/fault-campaign.md
	$(BIN)/python -m hil_tests.random_faults --minutes 60

bench-diagnosis: setup-baselines ## hidden effects against `bowden diagnose` and its rivals (SEED=...); hours; build/diagnosis.*
	$(BIN)/python -m hil_tests.benchmarks.diagnosis --seed $(SEED) $(BENCH_FLAGS)

bench-applied: native ## does the drive render as well with what is found as with the truth? (SEED=...); half an hour
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m hil_tests.benchmarks.applied --seed $(SEED) $(BENCH_FLAGS)

bench-feel: native ## what an operator feels who trembles, lets go or grasps, on two plants (SEED=...); an hour; docs/feel-benchmark.md
	$(BIN)/python -m hil_tests.benchmarks.feel --seed $(SEED) --page docs/feel-benchmark.md $(BENCH_FLAGS)

bench-calibration: setup ## are stated intervals true? (SEED=...); half an hour; build/calibration.json, docs/calibration-benchmark.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m hil_tests.benchmarks.calibration --seed $(SEED) --page docs/calibration-benchmark.md $(BENCH_FLAGS)

bench-data-gate: setup ## does the data gate name faults and leave good recordings alone? (SEED=...); an hour; docs/data-gate.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m hil_tests.benchmarks.data_gate --seed $(SEED) --page docs/data-gate.md $(BENCH_FLAGS)

bench-sensitivity: setup ## how a verdict depends on each constant of the diagnosis (SEED=...); an hour; docs/diagnosis-constants.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m hil_tests.benchmarks.sensitivity --seed $(SEED) --page docs/diagnosis-constants.md $(BENCH_FLAGS)

lock: setup ## resolve requirements.lock and requirements-baselines.lock anew (needs uv)
	$(COMPILE) --no-emit-package bowden --no-emit-package bowden-rig --no-emit-package bowden-bench \
	    requirements.in -o requirements.lock
	$(COMPILE) --override requirements.lock requirements-baselines.in -o requirements-baselines.lock

clean: ## remove what was built (not the virtual environment)
	rm -rf build .mypy_cache .ruff_cache .pytest_cache .hypothesis

# --- what the targets need -------------------------------------------------------------------

# $(call need,TEST COMMAND,DEBIAN PACKAGES): installs the packages when the test fails.
define need
	@$(1) >/dev/null 2>&1 || { \
	    if [ "$$(id -u)" = 0 ]; then as_root=; \
	    elif sudo -n true 2>/dev/null; then as_root=sudo; \
	    else echo "bowden: please install the Debian packages first: apt-get install $(2)" >&2; exit 1; fi; \
	    echo "bowden: installing Debian packages: $(2)" >&2; \
	    $$as_root apt-get update -qq && \
	    $$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(2) >/dev/null; }
endef

setup: $(VENV)/.ready

$(VENV)/.ready: requirements.lock host/pyproject.toml rig/pyproject.toml pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null || { \
	    echo "bowden: found $$($(PYTHON) --version 2>&1); accepted: Python 3.11 to 3.13 (set PYTHON=...)" >&2; exit 1; }
	$(call need,$(PYTHON) -c 'import ensurepip$(comma) venv',python3-venv)
	$(call need,gcc -E -include stdint.h -include stdio.h -x c /dev/null,gcc libc6-dev)
	@echo "bowden: making the virtual environment in $(VENV)" >&2
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps \
	    --no-compile -r requirements.lock
	@$(BIN)/python -W ignore -m compileall -qq -j 0 $(VENV)/lib || : # templates in it are no Python
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation -e host -e rig -e .
	@touch $@

setup-baselines: $(VENV)/.baselines

$(VENV)/.baselines: $(VENV)/.ready requirements-baselines.lock
	@echo "bowden: installing what the diagnosis is compared with" >&2
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps \
	    -r requirements-baselines.lock
	@touch $@

setup-firmware: setup
	$(call need,command -v arm-none-eabi-gcc,gcc-arm-none-eabi)

setup-browser: # without one the tests of pages are skipped
	-$(call need,{ command -v chromium || command -v chromium-browser; },chromium)

comma := ,
