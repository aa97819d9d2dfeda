"""The verbs that compute: one for each task, whatever the system."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.python.calibrations import estimate_of
from inercal.faces.python.result import Result, View
from inercal.faces.python.study import Study, study, study_of, with_reading
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.listed import SYSTEMS

if TYPE_CHECKING:
    from inercal.faces.report.html import Picture


def calibrate(
    records: Record | Sequence[Record],
    study: Study | str | Path | None = None,
    *,
    latitude: str | None = None,
    height: str | None = None,
    gravity: str | None = None,
    method: str | None = None,
    compare: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Result:
    """Calibrate an instrument from a recording, or measure an angle of attack: whatever the kind of the study is.

    Parameters
    ----------
    records : Record or sequence of Record
        One run; several are repeat runs of an IMU, a strapdown unit, a table or a platform, which are combined, or of
        the methods ``known_rates`` and ``known_turns`` of an IMU one for each rate or turn, in order.
    study : Study or path, optional
        Of an IMU ``latitude`` (and ``height``) or ``gravity`` can take its place: ``"48 deg"``, ``"9.81744(2) m/s^2"``.
    method : str, optional
        Of an IMU without a study; absent, ``"ferraris"`` of labelled sections, else ``"multiposition"``.
    compare : bool
        Also run the other estimators of a platform, or the other methods of an angle of attack.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    Result
        Its status says whether the values can be used; nothing is raised for a poor fit.

    Raises
    ------
    InputError
        The record does not hold what the method needs, or the study does not fit it.

    Examples
    --------
    >>> import inercal as ic
    >>> from inercal.examples import FOLDER
    >>> log = ic.read(FOLDER / "ferraris.csv.gz", map=FOLDER / "ferraris-map.toml")
    >>> found = ic.calibrate(log, gravity="9.81 m/s^2")
    >>> round(found["K1_x"].value), found["K1_x"].unit
    (209, 'count/(m/s^2)')
    """
    runs = [records] if isinstance(records, Record) else list(records)
    if not runs or not all(isinstance(each, Record) for each in runs):
        kind = (
            type(records).__name__ if not runs or isinstance(records, str | Path) else type(runs[0]).__name__
        )
        raise InputError("records", f"found {kind}, expected a record: ic.read(path) or ic.record(...)")
    keys = {"latitude": latitude, "height": height, "gravity": gravity, "method": method}
    given = {key: value for key, value in keys.items() if value is not None}
    if study is None:
        study = _imu_study(runs[0], given)
    elif given:
        raise StudyError(
            next(iter(given)), "found beside a study, expected it there, as by ic.study(path, ...)"
        )
    else:
        study = study_of(study)
    system = study.system
    if compare and not system.compares:
        expected = _kinds_with("compares")
        raise InputError("compare", f"found with a study of kind {study.kind}, expected one of {expected}")
    if system.prepare:
        system.prepare(study, compare)
    with _one_thread():
        return system.calibrate(runs, study, compare, progress)


def runs(
    table: str | Path,
    study: Study | str | Path,
    *,
    map: str | Path | None = None,
    compare: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Result:
    """Measure the angle of attack in all runs of a tunnel entry: wind-offs, polars up and down, oscillations.

    Parameters
    ----------
    table : str or Path
        A CSV ``file,role,angle,begin,amplitude,frequency``, a row a run, files beside it. Roles are ``wind-off`` (at
        rest at a known ``angle``, from which biases are interpolated to the runs between), ``up``, ``down``, ``run``.
    study : Study or path
        Of an angle of attack.
    map : str or Path, optional
        Column map of all files.
    compare : bool
        Also the other methods.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    Result
        By run, by point, by amplitude and frequency; its status is the worst of all runs.

    Raises
    ------
    InputError
        The table cannot be read, or a run cannot be measured; the sentence names the row or file.

    Examples
    --------
    >>> import inercal as ic, pathlib, tempfile
    >>> from inercal.examples import FOLDER
    >>> table = pathlib.Path(tempfile.mkdtemp()) / "runs.csv"
    >>> _ = table.write_text(f"file,role\\n{FOLDER / 'sting.csv.gz'},up\\n")
    >>> len(ic.runs(table, FOLDER / "sting.toml").estimate.result["runs"])
    1
    """
    from inercal.faces.python.recordings import read

    given = study_of(study)
    system = given.system
    if system.runs is None:
        raise StudyError(
            str(given.path or "study"), f"is of kind {given.kind}, expected one of kind {_kinds_with('runs')}"
        )
    if system.prepare:
        system.prepare(given, compare)
    with _one_thread():
        return system.runs(table, given, lambda path: read(path, map), compare, progress)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Linear algebra by one thread: of the small matrices here, two take up to twenty times the time of one."""
    import scipy.linalg  # noqa: F401  its library of its own has to be there before it is told
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


def _imu_study(record: Record, given: dict[str, str]) -> Study:
    """The study of an IMU without one: as `inercal new imu` begins it, at the site that is given."""
    if not given.keys() & {"latitude", "gravity"}:
        raise StudyError(
            "study",
            'missing, expected one, or of an IMU the site: latitude="48 deg" or gravity="9.81744(2) m/s^2"',
        )
    return study(IMU.kind, **(({"method": "ferraris"} if record.labels else {}) | given))


def simulate(study: Study | str | Path, rng: np.random.Generator) -> Record:
    """Simulate a recording of the test that a study plans: of an IMU, a strapdown unit, a turntable, a platform, or a
    model on a sting.

    Parameters
    ----------
    study : Study or path
    rng : numpy.random.Generator
        The same one gives the same record: ``numpy.random.default_rng(1)``, as ``--seed 1``.

    Returns
    -------
    Record

    Raises
    ------
    StudyError
        The study plans no test, or states no truth to simulate.

    Examples
    --------
    >>> import inercal as ic, numpy as np
    >>> from inercal.examples import FOLDER
    >>> record = ic.simulate(FOLDER / "selfcal.toml", np.random.default_rng(1))
    >>> list(record.columns)[:3]
    ['wc_x', 'wc_y', 'wc_z']
    """
    study = study_of(study)
    if not isinstance(rng, np.random.Generator):
        raise InputError("rng", f"found {type(rng).__name__}, expected numpy.random.default_rng(seed)")
    return study.system.simulate(study, rng)


def design(study: Study | str | Path, what: str | None = None) -> Result:
    """Find the positions or tolerances of a turntable, the path of a platform, or the turns of a strapdown unit, that
    tell most; of a model, say what its sensors can tell, beside the other layouts that the study states; of an IMU,
    what its sections tell, and which one more would help most.

    Parameters
    ----------
    study : Study or path
    what : str, optional
        ``"positions"`` or ``"tolerances"`` of a turntable, ``"selfcal"`` of a platform, ``"strapdown"`` of a strapdown
        unit, ``"aoa"`` of a model, ``"sections"`` of an IMU, as the commands name it; if absent, by the kind,
        positions.

    Returns
    -------
    Result
        Without coefficients: ``table()`` compares with plans of the field, ``evidence.plan`` is the best plan; of a
        model ``evidence.bounds`` are those of the layouts, of an IMU ``evidence.foretold`` is what the sections tell.

    Raises
    ------
    InputError
        There is no such design, or not of this kind of study.

    Examples
    --------
    >>> import inercal as ic
    >>> table = ic.study("turntable", latitude="45 deg", rig={"kind": "two_axis_turntable"},
    ...     instrument={"kind": "accelerometer", "unit": "g", "noise": "10 ug"}, design={"positions": 12})
    >>> len(ic.design(table, "positions").evidence.plan)
    12
    """
    study = study_of(study)
    designs = study.system.designs
    name = what or next(iter(designs), "")
    if name not in designs:
        names = " or ".join(map(repr, designs)) or f"one of {_kinds_with('designs')}"
        found = f"found {what!r} of" if what else "found"
        raise InputError("design", f"{found} a study of kind {study.kind}, expected {names}")
    designs[name].prepare(study)
    return designs[name].find(study)


def sensitivity(study: Study | str | Path) -> Result:
    """Say which error of a turntable matters for what the instrument should read.

    Returns
    -------
    Result
        Without coefficients: ``table()`` has Sobol indices by error, ``evidence.indices`` those of each position.

    Raises
    ------
    InputError
        The study is not of a turntable.

    Examples
    --------
    >>> import inercal as ic
    >>> table = ic.study("turntable", latitude="45 deg", rig={"kind": "two_axis_turntable",
    ...     "errors": {"default": {"uniform": "2 arcmin"}}}, positions={"plan": "24-position"})
    >>> print(ic.sensitivity(table).table().splitlines()[0].split())
    ['S', 'ST', 'S', 'ax', 'S', 'ay', 'S', 'az', 'S', 'wx', 'S', 'wy']
    """
    study = study_of(study)
    if (found := study.system.sensitivity) is None:
        expected = _kinds_with("sensitivity")
        raise InputError("sensitivity", f"found a study of kind {study.kind}, expected one of {expected}")
    return found(study)


def _kinds_with(offer: str) -> str:
    """The kinds of study whose systems offer this, in words."""
    *kinds, last = (kind for kind, system in SYSTEMS.items() if getattr(system, offer))
    return f"{', '.join(kinds)} or {last}" if kinds else last


def temperature(
    given: Record | Sequence[Result | Estimate | str | Path],
    at: str | float = 25.0,
    order: int | None = None,
) -> Result:
    """Fit what a sensor's output, or its calibration, does with temperature.

    Parameters
    ----------
    given : Record or sequence of Result or path
        A recording at rest over a sweep of temperature, or calibrations made at several, in the order of time.
    at : str or float
        Temperature about which the polynomial is written: ``"25 degC"``, or degrees Celsius.
    order : int, optional
        Highest power of temperature, 1 to 5. Without it, of a sweep that which the data tell, of calibrations 3.

    Returns
    -------
    Result
        A polynomial of each coefficient or channel, and its hysteresis.

    Raises
    ------
    InputError
        No temperature, or too little of it; no such order.

    Examples
    --------
    >>> import inercal as ic
    >>> from inercal.examples import FOLDER
    >>> sweep = ic.read(FOLDER / "thermal.csv.gz", map=FOLDER / "thermal-map.toml")
    >>> ic.temperature(sweep, at="30 degC").status.value
    'ok'
    """
    from inercal.foundation.units import parse_quantity
    from inercal.systems.imu.verbs import of_temperature

    about = parse_quantity(at, "temperature", "at").value if isinstance(at, str) else float(at)
    if isinstance(given, Record):
        from inercal.systems.imu.temperature.sweep import fit_recording

        clock = time.perf_counter()
        model = fit_recording(given, about, order)
    else:
        from inercal.foundation.records.read import source_of
        from inercal.systems.imu.temperature.calibrations import fit_calibrations

        estimates = [estimate_of(each)[0] for each in given]
        sources = [
            source
            for each, estimate in zip(given, estimates, strict=True)
            for source in ([source_of(each)] if isinstance(each, str | Path) else estimate.inputs[:1])
        ]
        clock = time.perf_counter()
        model = fit_calibrations(estimates, sources, about, order)
    estimate = timed(model.estimate, clock)
    if isinstance(given, Record):
        estimate = with_reading(estimate, given)
    return of_temperature(replace(model, estimate=estimate))


def allan(record: Record) -> Result:
    """Tell the noise of an instrument from a recording at rest.

    Parameters
    ----------
    record : Record
        At rest; ``record.between(...)`` takes a part of it.

    Returns
    -------
    Result
        N, B, K, R and Q of every channel that measures motion, with uncertainties; ``evidence.channels`` have the
        Allan deviations.

    Raises
    ------
    RecordError
        No such channel, hardly any samples, or time stamps that do not increase.

    Examples
    --------
    >>> import inercal as ic
    >>> import numpy as np
    >>> white = np.random.default_rng(1).standard_normal(6000) * 1e-3
    >>> noise = ic.allan(ic.record(gyro_z=white, rate=100.0))
    >>> round(noise["N_gyro_z"].value, 6), noise["N_gyro_z"].unit
    (0.0001, 'rad/sqrt(s)')
    """
    from inercal.foundation.noise.outcome import noise_of

    noise = noise_of(record)

    def tables() -> list[str]:
        from inercal.faces.report.allan import table

        return [table(noise)]

    def page() -> str:
        from inercal.faces.report.allan import page as of_page

        return of_page(noise)

    def picture() -> Picture:
        from inercal.faces.report.allan import pictures

        return pictures(noise)[0]

    estimate = with_reading(noise.estimate, record)
    first = noise.channels[0]
    seen = f"N_{first.name}"
    words = f"{len(noise.channels)} channels"
    if seen in estimate.names:
        words += f", of the first {seen} = {estimate[seen].value:.3g} {estimate[seen].unit}"
    return Result(estimate, View(estimate, words, tables, page, picture), noise)
