"""How long does a user wait? `inercal selfcal` on the 540 s record that ships with it, from cold process to report.

    python benchmarks/selfcal_command.py

The kernels are compiled before, by a first run. Beside it the same without a report, and `inercal --version`, which is
what Python and the command line take by themselves.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from inercal.examples import FOLDER

SELFCAL = ["selfcal", str(FOLDER / "selfcal.csv.gz"), "--study", str(FOLDER / "selfcal.toml"), "--quiet"]


def wall(arguments):
    """Seconds from start to end of a process."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-m", "inercal", *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--smoke", action="store_true", help="one run of each")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        report = ["--report", str(Path(folder) / "report.html")]
        first = wall([*SELFCAL, *report])
        print(f"first run, kernels compiled where they were not: {first:.2f} s")
        for name, arguments in (
            ("to the written report", [*SELFCAL, *report]),
            ("without a report", SELFCAL),
            ("--version", ["--version"]),
        ):
            times = sorted(wall(arguments) for _ in range(1 if options.smoke else 7))
            print(f"{name:>22}: {statistics.median(times):.2f} s ({times[0]:.2f} to {times[-1]:.2f})")


if __name__ == "__main__":
    main()
