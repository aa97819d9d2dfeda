"""Smoke test of an installed wheel: kernels are compiled ones, and the digits of an example are those of plain Python.

python kernels/smoke.py
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.metadata import distributions
from typing import Any, cast

RUN = """
import sys
from inercal.cli import run
from inercal.examples import FOLDER
from inercal.foundation._jit import way
print(way().how, file=sys.stderr)
files = [str(FOLDER / "lasergyro.txt.gz"), "--map", str(FOLDER / "lasergyro-map.toml")]
sys.exit(run(["allan", *files, "--json", "--quiet"]) > 1)
"""


def numbers(how: str) -> dict[str, dict[str, Any]]:
    """Values and uncertainties of an example, by name, from a process whose kernels run so."""
    done = subprocess.run(
        [sys.executable, "-c", RUN], env=os.environ | {"INERCAL_KERNELS": how}, capture_output=True, text=True
    )
    if done.returncode != 0 or how not in done.stderr:
        raise SystemExit(f"{how}: {done.stderr}")
    return {row["name"]: row for row in cast(list[dict[str, Any]], json.loads(done.stdout)["parameters"])}


def main() -> None:
    """Compare, to 9 digits: sums of plain Python may round otherwise."""
    if any(found.metadata["Name"].lower() == "numba" for found in distributions()):
        raise SystemExit("found numba, expected a wheel that does without")
    compiled, plain = numbers("compiled"), numbers("python")
    for name, row in plain.items():
        for key in ("value", "u"):
            a, b = compiled[name][key], row[key]
            if abs(a - b) > 1e-9 * abs(b):
                raise SystemExit(f"{name}, {key}: found {a!r} compiled, expected {b!r}")
    print(f"{len(plain)} values and uncertainties are those of plain Python")


if __name__ == "__main__":
    main()
