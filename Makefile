# Needs Python >= 3.10 and make. Every target creates the environment when it is missing.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: fit test lint bench clean

fit: .venv/ready
	$(BIN)/python examples/01_fit_vase.py --output output

test: .venv/ready
	$(BIN)/python -m pytest -q -n auto --maxprocesses 4

lint: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

bench: .venv/ready
	$(BIN)/python examples/benchmarks/ladder.py --output output
	$(BIN)/python examples/benchmarks/series.py --output output --points 131072
	$(BIN)/python examples/benchmarks/cost_of_models.py
	OMP_NUM_THREADS=1 $(BIN)/python examples/benchmarks/eager.py
	OMP_NUM_THREADS=1 $(BIN)/python examples/benchmarks/kernel.py

clean:
	rm -rf .venv build output *.egg-info .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# torch first: alone, so that a local CPU build is preferred to the registry's larger one
.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install -q -c constraints.txt torch
	$(BIN)/pip install -q -c constraints.txt -e ".[inverse,plots,fast,dev]"
	touch $@
