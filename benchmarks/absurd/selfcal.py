"""Absurd self-calibrations: rigs, paths, noise, priors, estimators and recordings that nobody would take."""

import numpy as np

from absurd import laws
from absurd.faults import spoiled
from absurd.outcome import made
from absurd.stream import streamed
from inercal.faces.stream.selfcal import Selfcal
from inercal.faces.studies.selfcal import selfcal_study
from inercal.systems.selfcal.estimators import KINDS
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.find_base import stated_well
from inercal.systems.selfcal.platform.coefficients import GROUPS
from inercal.systems.selfcal.result.columns import history_record
from inercal.systems.selfcal.simulate import experiment, simulate, to_record
from inercal.systems.selfcal.task import calibrate, compared, load_kernels

#: group -> its usual prior and unit
_PRIOR = {
    "kg0": (0.3, "deg/h"),
    "eta": (300.0, "arcsec"),
    "ds": (300.0, "arcsec"),
    "do": (300.0, "arcsec"),
    "ka0": (500.0, "ug"),
    "ka1": (1500.0, "ppm"),
    "kg1": (100.0, "ppm"),
    "beta": (60.0, "arcsec"),
}

SEARCH = {"inercal.systems.selfcal.task.diagnose": lambda *_: []}
"""The search for named faults -> what it finds where there are none; most of the time of a run."""

_COLUMNS = [[f"{sensor}_{axis}" for axis in "xyz"] for sensor in ("wc", "th", "acc")]


def load():
    """Load all kernels."""
    for extended in (False, True):
        study = {
            "site": {"latitude": "40 deg"},
            "rig": {"kind": "three_axis_gimbals"},
            "noise": {
                "angle_random_walk": "5e-4 deg/sqrt(h)",
                "accelerometer": "10 ug",
                "encoder": "2 arcsec",
            },
            "filter": {"extended": extended},
        }
        load_kernels(selfcal_study(study, "study.toml"), compare=True)


def run(rng):
    """One run, by one stream of random numbers."""
    return made(_study, _run, rng)


def _run(done, draws):
    done.outcome = "study refused"
    settings = selfcal_study(done.study, "study.toml")
    planned = experiment(settings)
    done.outcome = ""
    record = to_record(simulate(planned, draws.rng).recording)
    record, faults = spoiled(record, draws, _COLUMNS)
    if draws.absurd():
        record, more = _measured(record), ["measured rates"]
        faults += more
    done.words += faults
    if draws.chance(0.1):
        _stream(done, record, settings)
        return
    beside = draws.chance(0.02)
    done.words += ["compared"] if beside else []
    found = calibrate(record, settings, beside)
    estimate = found.estimate
    done.outcome = estimate.status.value
    done.wrong += laws.of_estimate(estimate)
    estimate.shown().table()
    history_record(found.filtered, found.recording, found.problem.world)
    if beside:
        compared(found)
    if done.outcome == "ok" and not done.words and _obeyed(done.study):
        done.wrong += laws.of_truth(estimate.values, estimate.u, found.truth, estimate.names)


def _measured(record):
    """The record with rates that gyros measured in the place of commanded ones."""
    columns = dict(record.columns)
    for axis in "xyz":
        if f"wc_{axis}" in columns:
            columns[f"gyro_{axis}"] = columns.pop(f"wc_{axis}")
    return type(record)(columns, record.findings, record.sources)


def _stream(done, record, settings):
    """The same row by row."""
    done.words.append("stream")
    stated_well(settings, "a stream")
    told = problem(settings)
    columns, rows, codes = streamed(lambda lines, say: Selfcal(lines, told, 0.0, say), record)
    done.outcome = "stream"
    known = [k for k, name in enumerate(columns) if name.split()[0] not in ("nis", "nis_mean")]
    if not np.isfinite(rows[:, known]).all() and "filter_fails" not in codes:
        done.wrong.append("a line holds no number, and nothing was said of it")


def _obeyed(study):
    """True where a recording without faults is as the study says: the truth within four of its prior's u."""
    return not study["disturbances"].keys() & {"harmonics", "command_delay"} and all(
        abs(float(true.split()[0])) <= 4.0 * _deviation(study, group)
        for group, three in study["truth"].items()
        for true in three
    )


def _deviation(study, group):
    """The prior of a group, in its usual unit."""
    text = study["prior"].get(group)
    return _PRIOR[group][0] if text is None else float(text.split()[0])


def _study(draws):
    """A study, as parsed from its file."""
    extended = draws.chance(0.3)
    prior, truth = {}, {}
    for group, (usual, unit) in _PRIOR.items():
        if group in ("kg1", "beta") and not extended:
            continue
        deviation = usual * draws.factor(8.0)
        if draws.chance(0.9):
            prior[group] = f"{deviation:.6g} {unit}" if draws.chance(0.995) else "0 " + unit
        else:
            deviation = usual
        true = deviation * draws.rng.standard_normal(3)
        if draws.absurd():
            true *= draws.factor(6.0)
        truth[group] = [f"{each:.9g} {unit}" for each in true]
    study = {
        "site": draws.site(),
        "rig": _rig(draws),
        "plan": _plan(draws),
        "truth": truth,
        "noise": {
            "angle_random_walk": draws.text(5e-4, "deg/sqrt(h)", 8.0),
            "accelerometer": draws.text(10.0, "ug", 8.0),
            "encoder": draws.text(2.0, "arcsec", 8.0),
        },
        "prior": prior,
        "filter": {"kind": draws.pick(*KINDS), "extended": extended},
        "disturbances": _disturbances(draws),
    }
    if draws.chance(0.3):
        study["filter"] |= {
            "gating": draws.pick("off", "any", "two", "channel"),
            "gating_stops": draws.pick("accelerometers", "step"),
            "factor": draws.pick("cholesky", "eigen", "svd"),
            "integration": draws.pick("rk4", "euler"),
        }
    if draws.chance(0.2):
        group = draws.pick(*GROUPS)
        study["goal"] = {group: draws.text(0.01 * _PRIOR[group][0], _PRIOR[group][1])}
    return study


def _rig(draws):
    rig = {"kind": "three_axis_gimbals"}
    match draws.pick("none", "none", "exact", "uncertain", "unknown"):
        case "exact":
            rig["heading"] = f"{draws.angle():.9g} deg"
        case "uncertain":
            rig["heading"] = draws.uncertain(draws.angle(), 0.01, "deg")
        case "unknown":
            rig["heading"] = "unknown"
    if draws.chance(0.3):
        size = draws.log(1e-6, 90.0) if draws.absurd() else 0.1
        rig["tilt"] = [draws.uncertain(each, 0.01, "deg") for each in draws.rng.uniform(-size, size, 2)]
    if draws.chance(0.3):
        rig["frame"] = draws.pick("nue", "enu", "ned")
        rig["gimbals"] = [str(each) for each in draws.rng.permutation(list("xyz"))]
        rig["signs"] = [int(each) for each in draws.rng.choice([-1, 1], 3)]
    return rig


def _plan(draws):
    """A path of some hundred rows at most."""
    if draws.chance(0.5):
        name, step = draws.pick("paper", "best", "plain"), draws.pick(6.0, 10.0, 15.0)
        factor = draws.factor(4.0)
        return {"path": name, "step": f"{step * factor:.9g} s", "rate": f"{1.0 / factor:.9g} deg/s"}
    rows = int(draws.log(12, 80))
    if draws.absurd():
        rows = draws.pick(8, 10, 11, 300)
    step = 0.2 * draws.factor(5.0)
    moves = []
    count = int(draws.rng.integers(1, 6))
    for part in draws.rng.dirichlet(np.ones(count)):
        duration = max(1, round(part * rows)) * step
        if draws.chance(0.15):
            moves.append(["rest", f"{duration:.9g} s"])
            continue
        angle = draws.pick(90.0, 180.0, -90.0, -180.0, 360.0) if draws.chance(0.6) else draws.angle()
        angle = angle or 1.0
        moves.append([draws.pick("x", "y", "z"), f"{angle:.9g} deg", f"{abs(angle) / duration:.9g} deg/s"])
    plan = {"turns": moves, "step": f"{step:.9g} s"}
    if draws.chance(0.3):
        plan["start"] = [f"{draws.angle():.9g} deg" for _ in range(3)]
    return plan


def _disturbances(draws):
    found = {}
    if draws.chance(0.1):
        found["dropouts"] = f"{draws.rng.random():.4f}"
    if draws.absurd():
        found["harmonics"] = [
            {
                "axis": draws.pick("x", "y", "z"),
                "order": int(draws.pick(1, 2, 7, 1000)),
                "amplitude": draws.text(5.0, "arcsec"),
            }
        ]
    if draws.absurd():
        found["command_delay"] = draws.text(0.05, "s", 4.0)
    return found
