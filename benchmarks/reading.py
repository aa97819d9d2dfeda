"""A recording of an IMU as text and as HDF5, read with all checks, beside pandas, pyarrow, polars and h5py, which check
nothing.

    python benchmarks/reading.py [--quick]

A million rows of a time and six channels with six to eight decimals, and the same with one number missing in 20 000
rows. Ours includes the checksum of the file and the checks of all channels. Each reader gives the same floats.
"""

import io
import os
import resource
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("POLARS_MAX_THREADS", "1")

import h5py
import numpy as np
import pandas
import polars
from measure import Row, Spread, alone, in_turn, named, row
from pyarrow import csv

from inercal.foundation.records.read import read

TITLES = "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]"
HOLE = 20_000


def recording(n: int) -> str:
    """An IMU that trembles, as text."""
    rng = np.random.default_rng(1)
    samples = np.column_stack([np.arange(n) / 1000.0, rng.normal(size=(n, 6))])
    text = io.StringIO()
    np.savetxt(
        text, samples, fmt=["%.3f"] + ["%.6f"] * 3 + ["%.8f"] * 3, delimiter=",", header=TITLES, comments=""
    )
    return text.getvalue()


def processor() -> float:
    """Processor time [s] of this process and of its children: binary files are read in one."""
    of = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in of)


def stored(path: Path, n: int) -> Path:
    """The same numbers as one matrix, and a map of its columns; the path of the map."""
    rng = np.random.default_rng(1)
    with h5py.File(path, "w") as file:
        file["data"] = np.column_stack([np.arange(n) / 1000.0, rng.normal(size=(n, 6))])
    columns = [title.rstrip("]").split(" [") for title in TITLES.split(",")]
    entries = [
        f'[columns.{name}]\nfrom = ["data", {k}]\nunit = "{unit}"' for k, (name, unit) in enumerate(columns)
    ]
    place = path.with_suffix(".toml")
    place.write_text("\n".join(entries))
    return place


def matrix(path: Path) -> np.ndarray:
    """The matrix as h5py gives it."""
    with h5py.File(path) as file:
        return file["data"][()]


def with_holes(text: str) -> str:
    """The same without one number in some rows."""
    lines = text.split("\n")
    for k in range(HOLE // 2, len(lines) - 1, HOLE):
        fields = lines[k].split(",")
        lines[k] = ",".join([*fields[:3], "", *fields[4:]])
    return "\n".join(lines)


def rows(quick: bool) -> list[Row]:
    n, rounds = (20_000, 1) if quick else (1_000_000, 3)
    text = recording(n)
    alone_options = csv.ReadOptions(use_threads=False)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for what, content in (("Text, read and checked", text), ("The same with holes", with_holes(text))):
            path = Path(folder) / "a.csv"
            path.write_text(content)
            ours, theirs = read(path), pandas.read_csv(path)
            away = float(np.nanmax(np.abs(ours["gyro_z"].values - theirs.iloc[:, 6].to_numpy())))
            assert np.isnan(ours["acc_z"].values).sum() == theirs.iloc[:, 3].isna().sum()
            seconds = in_turn(
                {
                    "ours": lambda path=path: read(path),
                    "pandas": lambda path=path: pandas.read_csv(path),
                    "pyarrow": lambda path=path: csv.read_csv(path, read_options=alone_options),
                    "polars": lambda path=path: polars.read_csv(path),
                },
                rounds,
            )
            size = f"{n} rows of 7 numbers"
            found += [
                row(what, size, ("s", 1.0), seconds["ours"], named(peer), seconds[peer])
                for peer in ("pandas", "pyarrow", "polars")
            ]
            unit = "rad/s"
            found.append(
                Row(f"{what}, difference", size, unit, Spread(away, away, away), "pandas", at_most=0.0)
            )
        path = Path(folder) / "a.h5"
        place = stored(path, n)
        away = float(np.abs(read(path, place)["gyro_z"].values - matrix(path)[:, 6]).max())
        works = {"ours": lambda: read(path, place), "h5py": lambda: matrix(path)}
        seconds = in_turn(works, rounds, processor)
        what, size = "HDF5, read and checked", f"{n} rows of 7 numbers"
        found.append(row(what, size, ("s", 1.0), seconds["ours"], named("h5py"), seconds["h5py"]))
        found.append(Row(f"{what}, difference", size, "rad/s", Spread(away, away, away), "h5py", at_most=0.0))
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
