# The commands a newcomer needs: `make demo` and `make kernels`, `make quick` and `make test`. Each makes its own environment.
PYTHON ?= python3
RUN := .venv/run/bin
DEV := .venv/dev/bin
DEMO := build/demo

# Where it is set, each of the many processes of the tests would parse every module again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo kernels wheel workbench quick test campaign coverage docs bench lock clean

demo: .venv/run/installed
	rm -rf $(DEMO)
	$(RUN)/inercal examples xsens --out $(DEMO) --quiet >/dev/null
	$(RUN)/inercal calibrate imu $(DEMO)/xsens_acc.mat $(DEMO)/xsens_gyro.mat \
	    --map $(DEMO)/xsens-map.toml --study $(DEMO)/xsens.toml \
	    --out $(DEMO)/calibration.json --report $(DEMO)/report.html
	@ls src/inercal/_kernels.* >/dev/null 2>&1 || echo "selfcal, aoa and strapdown need compiled kernels: make kernels (a minute, once)"

# Compiled for this machine's kind of processor, unless nothing they rest on has changed; done again after an update.
COMPILER = $(if $(wildcard .venv/dev/installed),.venv/dev,.venv/kernels)
kernels: $(COMPILER)/installed
	@$(COMPILER)/bin/python kernels/build.py --in-place

# One for this platform and all Pythons from 3.11, in dist; it needs neither a compiler nor numba where it is installed.
wheel: $(COMPILER)/installed
	$(COMPILER)/bin/python -m hatchling build -t wheel -d dist

# In the browser; sessions and jobs lie in build/workbench.
workbench: .venv/workbench/installed
	.venv/workbench/bin/inercal workbench build/workbench

# Under a minute: lint, types beside the tests, and of these what is near the change (tests/quick.py).
quick: .venv/dev/installed
	$(DEV)/ruff format --check --quiet .
	$(DEV)/ruff check --quiet .
	@$(DEV)/mypy & types=$$!; $(DEV)/python tests/quick.py; tests=$$?; wait $$types && exit $$tests

# Three workers for two processors: of what they run, servers and wires wait. They find the tests parsed, once for all,
# beside the check of types.
test: .venv/dev/installed
	$(DEV)/ruff format --check .
	$(DEV)/ruff check .
	@$(DEV)/python kernels/build.py --in-place
	@$(DEV)/mypy & types=$$!; $(DEV)/python -m pytest --collect-only -m "not campaign" >/dev/null; \
	    $(DEV)/python -m pytest -n 3 --dist worksteal -m "not campaign" --slow-rule list; \
	    tests=$$?; wait $$types && exit $$tests

# The full numbers of runs, of which `make test` has short versions; and tests of kernels, which there run compiled, as
# numba compiles them and as plain Python.
campaign: .venv/dev/installed
	$(DEV)/python kernels/build.py --in-place
	$(DEV)/python -m pytest -n 2 --dist worksteal -m campaign
	$(DEV)/python -m pytest -n 2 --dist worksteal -m "hypothesis and not campaign" --hypothesis-profile thorough
	INERCAL_KERNELS=numba $(DEV)/python -m pytest -n 2 --dist worksteal -m kernels
	INERCAL_KERNELS=python $(DEV)/python -m pytest -n 2 --dist worksteal -m kernels

# Compiled lines cannot be counted: short tests of kernels run once more with kernels as plain Python.
coverage: .venv/dev/installed
	rm -rf build/coverage
	$(DEV)/coverage run -m pytest -n 2 --dist worksteal -m "not campaign"
	INERCAL_KERNELS=python $(DEV)/coverage run -m pytest -n 2 --dist worksteal -m kernels
	$(DEV)/coverage combine --quiet
	$(DEV)/coverage report

docs: .venv/dev/installed
	$(DEV)/python -m sphinx --builder html --fail-on-warning --quiet --doctree-dir build/doctrees docs build/docs

# Some fifteen minutes. What it leaves out, the campaigns that are run alone, is named in benchmarks/run.py.
bench: .venv/dev/installed
	$(DEV)/python benchmarks/run.py --out build/bench

# Hashes and an editable install do not mix in one call, hence two; the second needs no network. The pins are complete,
# so nothing is resolved; what is imported is byte-compiled then, the rest never. pip unpacks on one processor: two of
# them, each with every second package.
.venv/run/installed: requirements/run.txt pyproject.toml
.venv/dev/installed: requirements/dev.txt pyproject.toml
.venv/kernels/installed: requirements/kernels.txt pyproject.toml
.venv/workbench/installed: requirements/workbench.txt pyproject.toml
.venv/%/installed:
	$(PYTHON) -m venv --clear .venv/$*
	awk '/^[a-zA-Z]/ {half = 1 - half} {print > (".venv/$*/half-" half)}' requirements/$*.txt
	@half() { .venv/$*/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-compile \
	    --require-hashes -r .venv/$*/half-$$1; }; \
	    half 0 & one=$$!; half 1; other=$$?; wait $$one && exit $$other
	.venv/$*/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

# Pins for every platform and Python from 3.11 on; needs uv. The files hold hashes and no addresses.
lock:
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	    pyproject.toml requirements/build.in -o requirements/run.txt
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	    --extra workbench pyproject.toml requirements/build.in -o requirements/workbench.txt
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	    --group dev pyproject.toml requirements/build.in -o requirements/dev.txt
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	    --group kernels requirements/build.in -o requirements/kernels.txt

clean:
	rm -rf .venv build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
