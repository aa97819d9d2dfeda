"""A strapdown unit calibrated from rests and turns: the record of PSINS in 19 positions, 982 s at 100 Hz.

    python benchmarks/strapdown_record.py [--quick]

The peer's time is what its authors' filter (sysclbt, five passes over 43 states) took in Octave on the machine where it
was run for the spec, 265 s: the languages differ, and no uncertainties are in it.
"""

import os
import subprocess
import sys
import tempfile

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measure import Row, Spread, alone, in_turn, of_processes, row, spread

from inercal.examples import FOLDER
from inercal.faces.studies.load import load_strapdown_study
from inercal.faces.validate.strapdown import errors_over_u
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.systems.strapdown.fit.batch import fit
from inercal.systems.strapdown.fit.error_state import filtered
from inercal.systems.strapdown.fit.rests import found_rests, nodes_of
from inercal.systems.strapdown.reading import samples_of

RECORD = str(FOLDER / "strapdown.bin.gz")
WORDS = ("calibrate", "strapdown", RECORD, "--map", str(FOLDER / "strapdown-map.toml"), "--study",
         str(FOLDER / "strapdown.toml"), "--quiet")  # fmt: skip
PEER, PEER_S = "PSINS sysclbt, in Octave", 265.0


def run(**more: str) -> None:
    """The whole command."""
    words = [sys.executable, "-m", "inercal", *WORDS]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **more})


def compiled_anew() -> float:
    """Seconds of a processor that a first run takes, with nothing compiled before."""
    with tempfile.TemporaryDirectory() as folder:
        began = of_processes()
        run(XDG_CACHE_HOME=folder, NUMBA_CACHE_DIR=folder)
        return of_processes() - began


def rows(quick: bool) -> list[Row]:
    settings = load_strapdown_study(FOLDER / "strapdown.toml")
    samples = samples_of(read([RECORD], read_map(FOLDER / "strapdown-map.toml")))
    nodes = nodes_of(samples, found_rests(samples, settings.rests), settings.rests.node)
    size, rounds = f"{len(samples.rate)} samples, 31 coefficients", 1 if quick else 5
    found = in_turn(
        {
            "batch": lambda: fit(samples, nodes, settings),
            "filter": lambda: filtered(samples, nodes, settings),
        },
        rounds,
    )
    whole = in_turn({"whole": run}, rounds, of_processes)["whole"]
    error = float(np.max(np.abs(errors_over_u())))
    peer = [PEER_S] * len(found["batch"])
    made = [
        row("Rests and turns, batch", size, ("s", 1.0), found["batch"], PEER, peer, at_most=1.5),
        row("The same by the error-state filter", size, ("s", 1.0), found["filter"], PEER, peer, at_most=1.0),
        row("The whole process", size, ("s", 1.0), whole, PEER, [PEER_S] * len(whole), at_most=4.0),
        Row("Largest error of a coefficient", size, "u", Spread(error, error, error), at_most=0.3),
    ]
    if not quick:
        made.append(Row("The first run, which compiles", size, "s", spread([compiled_anew()])))
    return made


if __name__ == "__main__":
    alone(rows, __doc__)
