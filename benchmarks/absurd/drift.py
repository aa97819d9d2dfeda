"""Absurd calibrations on a turntable: tables, positions, terms, noise and readings that nobody would take."""

from absurd import laws
from absurd.faults import spoiled
from absurd.outcome import made
from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.instruments.by_angle import CHANNELS, channel_model
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.rigs.plans import NAMED
from inercal.foundation.rigs.tables import slots
from inercal.systems.turntable.display import tolerances
from inercal.systems.turntable.task import PositionCalibration, calibrate, simulate

#: unit in the table of terms -> a usual size and its unit, by kind of output
_SIZES = {
    "output": {"rate": (1.0, "deg/h"), "acceleration": (100.0, "ug")},
    "output/(rad/s)": {"rate": (1.0, "")},
    "output/(m/s^2)": {"rate": (0.1, "deg/h/g"), "acceleration": (1.0, "")},
    "output/(m/s^2)^2": {"rate": (0.1, "deg/h/g^2")},
    "rad": {"rate": (60.0, "arcsec"), "acceleration": (60.0, "arcsec")},
    "1": {"rate": (50.0, "ppm"), "acceleration": (50.0, "ppm")},
    "1/(rad/s)": {"rate": (5.0, "ppm/(deg/s)")},
    "1/(rad/s)^2": {"rate": (0.1, "ppm/(deg/s)^2")},
    "1/(m/s^2)": {"acceleration": (5.0, "ug/g^2")},
    "1/(m/s^2)^2": {"acceleration": (1.0, "ug/g^3")},
}

SEARCH = {}
"""There is no search for named faults that would take time."""


def load():
    """Nothing is compiled here but what the rate test uses."""
    for kind in CHANNELS:
        for symbol in _symbols(kind):
            assert TERMS[symbol].unit in _SIZES, TERMS[symbol].unit


def run(rng):
    """One run, by one stream of random numbers."""
    return made(_study, _run, rng)


def _run(done, draws):
    done.outcome = "study refused"
    settings = turntable_study(done.study, "study.toml")
    simulated = simulate(settings, draws.rng)
    done.outcome = ""
    angles = [name for name in simulated.columns if name.startswith("phi")]
    outputs = [name for name in simulated.columns if name in CHANNELS[settings.instrument.kind]]
    others = [name for name in ("position", "rate") if name in simulated.columns]
    record, faults = spoiled(
        simulated, draws, [angles, outputs, outputs, others] if others else [angles, outputs]
    )
    done.words += faults
    found = calibrate(record, settings)
    estimate = found.estimate
    done.outcome = estimate.status.value
    done.wrong += laws.of_estimate(estimate)
    if isinstance(found, PositionCalibration):
        found.shown.table()
    tolerances(estimate)
    if done.outcome == "ok" and not faults and isinstance(found, PositionCalibration) and _obeyed(estimate):
        truth = [settings.instrument.coefficients.get(name, _unstated(name)) for name in estimate.names]
        done.wrong += laws.of_truth(estimate.values, estimate.u, truth, estimate.names)


def _unstated(name):
    """Value of a term of which the study says nothing: 1 for a scale factor, else 0."""
    return 1.0 if name in ("k_x", "kY_y") or name.startswith(("S_", "K1_")) else 0.0


def _obeyed(estimate):
    """True where errors of the table are small enough beside the noise for the model."""
    return all(finding.code != "large_errors" for finding in estimate.findings)


def _symbols(kind):
    return [symbol for channel in CHANNELS[kind] for symbol in channel_model(kind, channel).symbols]


def _study(draws):
    """A study, as parsed from its file."""
    kind = draws.pick("two_axis_turntable", "two_axis_turntable", "three_axis_turntable")
    instrument = _instrument(draws)
    study = {
        "site": draws.site(),
        "rig": {"kind": kind, "errors": _errors(draws, kind)},
        "positions": _positions(draws, kind),
        "instrument": instrument,
    }
    if draws.chance(0.2):
        study["rig"]["base"] = {
            "azimuth": f"{draws.angle():.9g} deg",
            "tilt_north": f"{draws.angle():.9g} deg",
        }
    if instrument["kind"] == "gyro" and draws.chance(0.4):
        study["rate_test"] = _rate_test(draws, kind)
    return study


def _errors(draws, kind):
    if draws.chance(0.2):
        return {}
    found = {"default": _error(draws, 2.0)} if draws.chance(0.8) else {}
    names = list(slots(kind))
    for _ in range(int(draws.rng.integers(0, 4))):
        slot = draws.pick(*names)
        if draws.chance(0.2):
            found[slot.name] = "none"
        elif slot.is_offset:
            found[slot.name] = {"uniform": draws.text(10.0, "um")}
        else:
            found[slot.name] = _error(draws, 1.0)
    return found


def _error(draws, size):
    usual = min(size * draws.factor(6.0), 3000.0)
    table = {draws.pick("uniform", "normal", "triangular", "two_point"): f"{usual:.9g} arcmin"}
    if draws.chance(0.3):
        table["scope"] = draws.pick("sample", "position", "run", "rig")
    return table


def _positions(draws, kind):
    joints = 2 if kind.startswith("two") else 3
    if joints == 2 and draws.chance(0.4):
        return {"plan": draws.pick(*NAMED)}
    if draws.chance(0.3):
        counts = draws.rng.integers(1, 7 if joints == 2 else 4, joints)
        return {
            "grid": {f"phi{k + 1}": int(count) for k, count in enumerate(counts)}
            | {"offset": draws.pick("half", "none")}
        }
    count = draws.pick(1, 2, 5, 12, 24, 40)
    if draws.absurd():
        count = draws.pick(1, 2, 3, 100)
    if draws.chance(0.5):
        rows = [[90.0 * int(each) for each in draws.rng.integers(-4, 5, joints)] for _ in range(count)]
    else:
        rows = [[draws.angle() for _ in range(joints)] for _ in range(count)]
    if draws.absurd():
        rows = [draws.pick(*rows) for _ in rows]
    return {"list": [[f"{angle:.9g} deg" for angle in row] for row in rows]}


def _instrument(draws):
    kind = draws.pick("gyrowheel", "gyrowheel", "gyro", "accelerometer")
    output = "acceleration" if kind == "accelerometer" else "rate"
    table = {"kind": kind, "dwell": draws.text(60.0, "s", 5.0)}
    if draws.chance(0.8):
        usual, unit = (10.0, "ug") if kind == "accelerometer" else (0.01, "deg/h")
        table["noise"] = draws.text(usual, unit, 8.0)
    symbols = _symbols(kind)
    if draws.chance(0.4):
        count = int(draws.rng.integers(1, len(symbols) + 1))
        table["terms"] = [str(each) for each in draws.rng.permutation(symbols)[:count]]
    coefficients = {}
    for symbol in symbols:
        if draws.chance(0.6):
            usual, unit = _SIZES[TERMS[symbol].unit][output]
            value = (1.0 if unit == "" else draws.rng.standard_normal()) * usual * draws.factor(6.0)
            coefficients[symbol] = (
                draws.uncertain(value, 0.01 * usual, unit).strip()
                if draws.chance(0.1)
                else f"{value:.9g} {unit}".strip()
            )
    table["coefficients"] = coefficients
    if draws.chance(0.15):
        table["dwell"] = "10 s"
        table["sample_rate"] = draws.pick("0.5 Hz", "2 Hz", "0.01 Hz")
    if draws.chance(0.3):
        table["earth_rate"] = draws.pick("fitted", "stated")
    return table


def _rate_test(draws, kind):
    joints = ("phi1", "phi2") if kind.startswith("two") else ("phi1", "phi2", "phi3")
    count = draws.pick(1, 2, 3, 6, 10)
    rates = [draws.pick(-1.0, 1.0) * draws.log(1e-3, 1e3) * draws.factor(6.0) for _ in range(count)]
    if draws.chance(0.5):
        rates = [sign * rate for rate in (1.0, 10.0, 50.0, 100.0) for sign in (1, -1)]
    if draws.absurd():
        rates = [draws.pick(*rates, 0.0) for _ in rates]
    table = {"joint": draws.pick(*joints), "order": draws.pick(1, 2, 3)}
    table["rates"] = [f"{rate:.9g} deg/s" for rate in rates]
    if draws.chance(0.3):
        table["rate_uncertainty"] = draws.text(20.0, "ppm")
    if draws.chance(0.3):
        table["full_scale"] = draws.text(100.0, "deg/s")
    if draws.chance(0.3):
        table["at"] = {draws.pick(*joints): f"{draws.angle():.9g} deg"}
    return table
