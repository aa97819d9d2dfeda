"""A case of the validation, the recordings and sources it rests on, and the verdict on it.

A case compares numbers that the package finds with numbers from elsewhere. It passes where all of them are within their
limits, which follow from the digits that were printed, from what was stated by the source, or from statistics.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from inercal.examples import EXAMPLES, FOLDER
from inercal.foundation.arrays import Array
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.record import Record

#: as a line of the command names it -> in full
SOURCES = {
    "GUM H.3": "JCGM 100:2008, Guide to the expression of uncertainty in measurement, H.3 (thermometer), table H.6 "
    "and H.3.3, H.3.4",
    "GUM table G.2": "JCGM 100:2008, table G.2: t_p(nu) for p = 95.45 %",
    "NIST StRD": "NIST Statistical Reference Datasets, regression: certified values",
    "NIST SP 1065": "W. J. Riley and D. A. Howe, Handbook of Frequency Stability Analysis, NIST SP 1065 (2008), "
    "section 12.4, tables 30 and 31; the first from NBS Monograph 140, annex 8.E",
    "Stable32": "W. J. Riley, Stable32 1.60, overlapping Allan deviation of its data set PHASE.DAT, which is the sum "
    "of the 1000 numbers of NIST SP 1065",
    "AllanTools": "AllanTools 2024.6 (A. Wallin and others), oadev, run on the recording of PSINS that ships",
    "WGS 84": "NIMA TR8350.2, Department of Defense World Geodetic System 1984, third edition, amendment 1 (2000), "
    "tables 3.1 and 3.4, normal gravity",
    "SI brochure": "BIPM, The International System of Units, 9th edition (2019), table 8; standard gravity: third CGPM "
    "(1901)",
    "imu_tk": "D. Tedaldi, A. Pretto, E. Menegatti, A robust and easy to implement method for IMU calibration without "
    "external equipments, ICRA 2014: their program imu_tk on their recording; limits: by how much it and the authors' "
    "MATLAB program differ, or what the scatter of poses and turns leaves (standard uncertainty of M_xz, expanded one "
    "of the gyro)",
    "imucal": "imucal 2.6.0 (A. Kuederle and others), results published with its example sessions",
    "pyins": "pyins 8377ede (N. Mayorov), simulated turntable, truth of the simulation; limits: the largest errors of "
    "pyins' own calibration of it",
    "TofuPilot": "TofuPilot examples fc190f7, thermal calibration: its cubic fits of the recording that ships",
    "Zhao 2023": "Zhao et al. 2023, on the errors of a two-axis turntable: its statements that hold, in closed form to "
    "leading order",
    "Tan 2021": "Tan et al. 2021, Large angle-of-attack measurement architecture for wind-tunnel models based on "
    "inertial technology: its figures, under the conditions in which they hold",
    "PSINS": "PSINS (G. Yan, Northwestern Polytechnical University), record imusysclbt.bin of a unit in 19 positions, "
    "simulated: the errors that were injected; limit: 0.3 u",
    "closed form": "a closed form or an identity that the case states",
    "truth": "the truth behind a simulation; limits from statistics",
}


#: the examples that cases use
USED = (
    "xsens", "ferraris", "ferraris-si", "table", "lasergyro", "thermal", "selfcal", "sting", "strapdown",
)  # fmt: skip


def record_of(name: str) -> Record:
    """The recording of an example of `USED`, by its map if it has one; raises KeyError for another."""
    if name not in USED:
        raise KeyError(name)
    example = EXAMPLES[name]
    columns = read_map(FOLDER / example.map) if example.map else None
    return read([FOLDER / file for file in example.records], columns)


def study_of(name: str) -> Path:
    """The study of an example; raises KeyError where it has none."""
    study = EXAMPLES[name].study
    if study is None:
        raise KeyError(f"{name} has no study")
    return FOLDER / study


@dataclass(frozen=True, eq=False)
class Case:
    """One comparison.

    ``name`` is short, of small letters, digits and hyphens; ``shows`` says what a pass says, in a sentence without a
    full stop; ``source`` is a key of `SOURCES`. The numbers ``expected`` (n,) may be off by ``limit`` (n,), or one
    number for all; ``find`` gives them as the package has them, in ``unit``.
    """

    name: str
    shows: str
    source: str
    expected: ArrayLike
    limit: ArrayLike
    find: Callable[[], ArrayLike]
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Numbers:
    """Outcome of a case: ``values`` (n,) and the ``seconds`` they took; ``error`` says in one line why there are
    none."""

    values: Array
    seconds: float = 0.0
    error: str = ""


@dataclass(frozen=True)
class Outcome:
    """The verdict on a case, and of its ``count`` numbers the one that is furthest off in terms of its limit.

    ``figure`` was found where ``expected`` was, with ``limit`` allowed; ``seconds`` it took. ``error`` says why there
    are no numbers; ``figure`` is then NaN.
    """

    name: str
    passed: bool
    figure: float
    expected: float
    limit: float
    count: int
    seconds: float
    error: str = ""


def find(case: Case) -> Numbers:
    """The numbers of a case; whatever goes wrong is kept as a reason, for the next case is to be tried too."""
    began = time.perf_counter()
    try:
        values = np.asarray(case.find(), dtype=float).ravel()
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        return Numbers(np.empty(0), time.perf_counter() - began, reason)
    return Numbers(values, time.perf_counter() - began)


def judge(case: Case, numbers: Numbers) -> Outcome:
    """The verdict on what a case found: numbers that are missing, too many, or none (NaN) do not pass."""
    expected = np.asarray(case.expected, dtype=float).ravel()
    limit = np.broadcast_to(np.asarray(case.limit, dtype=float).ravel(), expected.shape)
    values, error = numbers.values, numbers.error
    if not error and len(values) != len(expected):
        error = f"found {len(values)} numbers, expected {len(expected)}"
    if error:
        values = np.full(len(expected), np.nan)
    off = np.abs(values - expected)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(off > 0.0, off / limit, np.where(off == 0.0, 0.0, np.inf))
    worst = int(np.argmax(share))
    return Outcome(
        case.name,
        bool(np.all(off <= limit)),  # not so of NaN
        float(values[worst]),
        float(expected[worst]),
        float(limit[worst]),
        len(expected),
        numbers.seconds,
        error,
    )
