"""What does it bring that kernels are compiled before? Commands of an installed wheel beside those of 0.2.0.

    python benchmarks/compiled_kernels.py WHEEL_PYTHON OLD_PYTHON [--rounds 5]

Both are the Python of an environment into which inercal alone, with what it needs, is installed. Commands run in turn
on the examples that ship with it, each in a process of its own: first with an empty cache, then again and again, of
which the least counts. Times are those of the processor, since others may work beside; memory is the largest.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from measure import yardstick

COMMANDS = {
    "selfcal": "selfcal {0}/selfcal.csv.gz --study {0}/selfcal.toml",
    "aoa": "aoa {0}/sting.csv.gz --study {0}/sting.toml",
    "calibrate imu": "calibrate imu {0}/xsens_acc.mat {0}/xsens_gyro.mat --map {0}/xsens-map.toml "
    "--study {0}/xsens.toml",
    "calibrate turntable": "calibrate turntable {0}/tumble.csv.gz --study {0}/tumble.toml",
}
ABOUT = """
import importlib.metadata, sys, inercal.examples
names = [found.metadata["Name"] for found in importlib.metadata.distributions()]
version = importlib.metadata.version("inercal")
print(inercal.examples.FOLDER, version, "numba" in names, sys.version.split()[0], sep="\\n")
"""


def used(words: list[str], cache: str) -> tuple[float, float]:
    """Processor time [s] and largest memory [MiB] of a process that must end well."""
    environment = {name: value for name, value in os.environ.items() if name != "INERCAL_KERNELS"}
    process = subprocess.Popen(
        words,
        env=environment | {"XDG_CACHE_HOME": cache, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": ""},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, spent = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(words)}: exit code {process.returncode}")
    return spent.ru_utime + spent.ru_stime, spent.ru_maxrss / 1024.0


def about(python: str) -> list[str]:
    """Folder of the examples, version, whether numba is there, and version of Python, of an environment."""
    environment = os.environ | {"PYTHONPATH": ""}
    done = subprocess.run([python, "-c", ABOUT], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split("\n")[:4]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("wheel", help="Python of the environment of the wheel")
    parser.add_argument("before", help="Python of the environment of 0.2.0")
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    if about(given.wheel)[2] != "False":
        raise SystemExit(f"{given.wheel}: found numba, expected an environment without")
    first: dict[tuple[str, str], tuple[float, float]] = {}
    later: dict[tuple[str, str], list[tuple[float, float]]] = {}
    with tempfile.TemporaryDirectory() as caches:
        for k in range(given.rounds + 1):
            print(f"round {k}, yardstick {yardstick():.0f} ms", file=sys.stderr, flush=True)
            for name, command in COMMANDS.items():
                for python in (given.before, given.wheel):
                    folder, *_ = about(python)
                    words = [str(Path(python).with_name("inercal")), *command.format(folder).split()]
                    cache = str(Path(caches, name.replace(" ", "-")))  # a first run of each
                    found = used(words, cache)
                    if k == 0:
                        first[name, python] = found
                    else:
                        later.setdefault((name, python), []).append(found)
    for python in (given.before, given.wheel):
        _, version, numba, of = about(python)
        print(
            f"{python}: inercal {version}, Python {of}, {'with' if numba == 'True' else 'without'} numba",
            file=sys.stderr,
        )
    print(
        "| Command, its shipped example | 0.2.0, first | 0.2.0 | Wheel, first | Wheel |\n|---|---|---|---|---|"
    )
    for name in COMMANDS:
        cells = [f"`{name}`"]
        for python in (given.before, given.wheel):
            least = min(seconds for seconds, _ in later[name, python])
            most = max(memory for _, memory in later[name, python])
            cells += ["{:.2f} s, {:.0f} MiB".format(*first[name, python]), f"{least:.2f} s, {most:.0f} MiB"]
        print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
