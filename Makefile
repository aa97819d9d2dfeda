# The two commands a newcomer needs: `make demo` and `make test`. Each makes its own environment.
PYTHON ?= python3
RUN := .venv/run/bin
DEV := .venv/dev/bin
DEMO := build/demo

.PHONY: demo test bench lock clean

demo: .venv/run/installed
	rm -rf $(DEMO)
	$(RUN)/inercal examples xsens --out $(DEMO) --quiet >/dev/null
	$(RUN)/inercal calibrate imu $(DEMO)/xsens_acc.mat $(DEMO)/xsens_gyro.mat \
	    --map $(DEMO)/xsens-map.toml --study $(DEMO)/xsens.toml \
	    --out $(DEMO)/calibration.json --report $(DEMO)/report.html

test: .venv/dev/installed
	$(DEV)/ruff format --check .
	$(DEV)/ruff check .
	$(DEV)/mypy
	$(DEV)/python -m pytest -n 2

bench: .venv/dev/installed
	$(DEV)/python benchmarks/imu_calibration.py
	$(DEV)/python benchmarks/sensitivity.py
	$(DEV)/python benchmarks/ferraris.py
	$(DEV)/python benchmarks/allan.py
	$(DEV)/python benchmarks/streaming.py
	$(DEV)/python benchmarks/aoa_fusion.py
	$(DEV)/python benchmarks/selfcal_filters.py
	$(DEV)/python benchmarks/selfcal_command.py
	$(DEV)/python benchmarks/selfcal_coverage.py --runs 1000

# Hashes and an editable install do not mix in one call, hence two; the second needs no network.
.venv/run/installed: requirements/run.txt pyproject.toml
.venv/dev/installed: requirements/dev.txt pyproject.toml
.venv/%/installed:
	$(PYTHON) -m venv --clear .venv/$*
	.venv/$*/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/$*.txt
	.venv/$*/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

# Pins for every platform and Python from 3.11 on; needs uv. The files hold hashes and no addresses.
lock:
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	    pyproject.toml requirements/build.in -o requirements/run.txt
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	    --group dev pyproject.toml requirements/build.in -o requirements/dev.txt

clean:
	rm -rf .venv build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
