"""Are the stated uncertainties of self-calibration true, and do they reach the bound? A campaign of simulated runs.

    python benchmarks/selfcal_coverage.py --study STUDY.toml --runs 1000 --filter error-state

Without a study it is the paper's (`inercal examples selfcal`). An interrupted campaign with --checkpoint goes on where
it stopped. Its results are kept in docs/uncertainty/self-calibration.md.
"""

import argparse
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from campaigns.places import add_options, in_words, place_of, progress

from inercal.examples import FOLDER
from inercal.faces.studies.load import load_selfcal_study
from inercal.systems.selfcal.estimators import KINDS
from inercal.systems.selfcal.monte_carlo import campaign

SEED = 20261121


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--study", type=Path, help="study with plan and truth")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--filter", choices=KINDS, default="error-state")
    parser.add_argument("--set", action="append", default=[], help="override one key of the study: key=value")
    add_options(parser)
    options = parser.parse_args()

    settings = load_selfcal_study(options.study or FOLDER / "selfcal.toml", options.set)
    began = time.perf_counter()
    found = campaign(
        settings,
        options.runs,
        SEED,
        options.filter,
        executor=place_of(options),
        folder=options.checkpoint,
        progress=progress,
    )
    print(found.table())
    print(f"{options.runs / (time.perf_counter() - began):.0f} runs/s, simulation included")


if __name__ == "__main__":
    in_words(main)
