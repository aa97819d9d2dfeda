"""Absurd measurements of the angle of attack: layouts, noise, motions and recordings that nobody would take."""

from dataclasses import replace

import numpy as np

from absurd import laws
from absurd.draws import Draws
from absurd.faults import spoiled
from absurd.outcome import made
from absurd.stream import streamed
from inercal.faces.stream.aoa import Aoa
from inercal.faces.studies.aoa import aoa_study
from inercal.foundation.errors import StudyError
from inercal.systems.aoa.estimators import STATICS
from inercal.systems.aoa.result.columns import angles_record, points_record
from inercal.systems.aoa.result.tables import answer, delays, on_page, on_terminal, rest_of_fit, use_of_fit
from inercal.systems.aoa.settings import GYROS, Methods
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import load_kernels, measure

_NOISE = {
    "accelerometer": (1e-4, "g"),
    "accelerometer_bias": (1e-4, "g"),
    "gyro": (0.2, "deg/s"),
    "gyro_bias": (5.0, "deg/h"),
}

SEARCH = {
    "inercal.systems.aoa.diagnosis.examination._explaining": lambda *_: [],
    "inercal.systems.aoa.estimation.diagnose": lambda *_: [],
}
"""The search for named faults -> what it finds where there are none; most of the time of a run."""


def load():
    """Load all kernels."""
    draws = Draws(np.random.default_rng(0))
    draws.wild = 0.0
    study = _study(draws)
    load_kernels(aoa_study({**study, "estimator": {"states": 19}}, "study.toml"), compare=True)


def run(rng):
    """One run, by one stream of random numbers."""
    return made(_study, _run, rng)


def _run(done, draws):
    done.outcome = "study refused"
    settings = aoa_study(done.study, "study.toml")
    simulated = simulate(settings, draws.rng)
    done.outcome = ""
    record = to_record(simulated.recording, settings)
    if draws.chance(0.4) and "theta_ref" in record:
        record = type(record)(
            {name: each for name, each in record.columns.items() if name != "theta_ref"},
            record.findings,
            record.sources,
        )
    accelerometers = [name for name in record.columns if name in settings.layout.names]
    gyros = [name for name in record.columns if name in GYROS]
    record, faults = spoiled(record, draws, [accelerometers, accelerometers, gyros, ["theta_ref", "point"]])
    done.words += faults
    if draws.chance(0.1):
        _stream(done, record, settings)
        return
    if draws.chance(0.3):
        methods = Methods(
            draws.pick(*STATICS),
            draws.pick("none", "low-pass", "mechanical", "decision"),
            draws.pick("none", "differentiated", "dual"),
        )
        done.words.append(repr(methods))
        settings = replace(settings, methods=methods, estimator=replace(settings.estimator, kind="paper"))
    beside = draws.chance(0.02)
    done.words += ["compared"] if beside else []
    found = measure(record, settings, beside)
    estimate = found.estimate
    done.outcome = estimate.status.value
    done.wrong += laws.of_estimate(estimate)
    for angles in (found.angles, *found.compared.values()):
        done.wrong += laws.of_angles(angles)
    answer(estimate, found.points, found.settings), on_page(estimate), on_terminal(estimate)
    delays(estimate), use_of_fit(estimate), rest_of_fit(estimate)
    angles_record(found.recording, found.angles, found.settings)
    points_record(found.points, found.recording, found.settings)
    if done.outcome == "ok" and not faults and found.filtered is not None and _obeyed(done.study):
        known = np.isfinite(found.angles.theta)
        off = np.remainder(found.angles.theta - simulated.theta + np.pi, 2.0 * np.pi) - np.pi
        done.wrong += laws.of_truth(off[known], found.angles.u[known], 0.0, ["theta"] * int(known.sum()))[:1]


def _stream(done, record, settings):
    """The same row by row."""
    done.words.append("stream")
    if settings.estimator.smooth:
        raise StudyError(
            "estimator.smooth", "found true with a stream, expected false: it knows the past alone"
        )
    columns, rows, _ = streamed(lambda lines, say: Aoa(lines, settings, 0.0, say), record)
    done.outcome = "stream"
    names = [name.split()[0] for name in columns]
    theta, u = rows[:, names.index("theta")], rows[:, names.index("u_theta")]
    if (np.isfinite(theta) != np.isfinite(u)).any() or (u < 0.0).any():
        done.wrong.append("a line has an angle without its uncertainty, or the other way round")


def _obeyed(study):
    """True where the recording is as the study says: undisturbed but by ranges, of a motion that the filter expects."""
    plain = not study["disturbances"] and "zero" not in study
    return plain and study["motion"]["kind"] in ("static", "sine")


def _study(draws):
    """A study, as parsed from its file."""
    motion = _motion(draws)
    study = {
        "site": draws.site(),
        "rig": {"kind": "sting"},
        "sensors": _sensors(draws),
        "noise": {name: draws.text(usual, unit, 8.0) for name, (usual, unit) in _NOISE.items()},
        "motion": motion,
        "disturbances": _disturbances(draws),
        "estimator": _estimator(draws),
    }
    if draws.chance(0.3):
        study["prior"] = _prior(draws)
    if draws.chance(0.3):
        study["timing"] = {
            "gyro_delay": "estimate" if draws.chance(0.5) else draws.text(2.0, "ms"),
            "common_delay": draws.uncertain(draws.rng.standard_normal(), 0.1, "ms"),
        }
    if draws.chance(0.3):
        study["model"] = {"roll": draws.uncertain(draws.angle() if draws.absurd() else 2.0, 0.1, "deg")}
    if draws.chance(0.2):
        study["model"] = study.get("model", {}) | {
            "yaw": draws.uncertain(draws.rng.uniform(-5, 5), 0.1, "deg")
        }
        study["flow"] = {"upwash": draws.uncertain(draws.rng.uniform(-1, 1), 0.02, "deg")}
    if draws.chance(0.1):
        study["zero"] = {
            "start": draws.text(0.01, "s", 3.0),
            "end": draws.text(2.0, "s", 3.0),
            "angle": draws.uncertain(draws.rng.uniform(-5, 5), 0.01, "deg"),
        }
    return study


def _sensors(draws):
    place = ("-0.25 m", "0.20 m", "0.25 m")
    sensors = {f"a{k + 1}": {"axis": axis, "r": place[k]} for k, axis in enumerate(("-z", "+x", "+z"))}
    if draws.chance(0.5):
        for k in range(int(draws.rng.integers(2, 7))):
            sensors[f"a{k + 1}"] = {"r": f"{draws.rng.uniform(-0.5, 0.5):.4f} m"}
            if draws.chance(0.6):
                sensors[f"a{k + 1}"]["axis"] = draws.pick("+x", "-x", "+z", "-z")
            else:
                sensors[f"a{k + 1}"]["angle"] = f"{draws.angle():.9g} deg"
    for sensor in sensors.values():
        if draws.absurd():
            sensor["r"] = draws.pick("0 m", "0.25 m", "-0.25 m", "4.9 m", "1e-9 m", "6 m")
        if draws.chance(0.2):
            sensor["z"] = f"{draws.rng.uniform(-0.2, 0.2):.4f} m"
        if draws.chance(0.1):
            sensor |= {"scale": draws.text(1.0, "", 4.0), "bias": draws.text(1.0, "mg", 4.0)}
        if draws.chance(0.2):
            sensor["range"] = draws.text(2.0, "g", 3.0)
    if draws.chance(0.3):
        sensors["gyro"] = {"range": draws.text(40.0, "deg/s", 3.0)}
    return sensors


def _motion(draws):
    """A motion of some hundred rows at most, at any rate of samples."""
    rows = int(draws.log(25, 200))
    if draws.absurd():
        rows = draws.pick(2, 3, 10, 500)
    rate = 200.0 * draws.factor(4.0)
    duration = rows / rate
    kind = draws.pick("static", "sine", "sine", "two-tone", "chirp", "buffet", "pitch-pause")
    motion = {"kind": kind, "sample_rate": f"{rate:.9g} Hz"}
    slow = 1.0 / duration if draws.absurd() else min(1.0, rate / 20.0)
    mean = f"{draws.angle():.9g} deg" if draws.chance(0.3) else "30 deg"
    if kind == "static":
        motion |= {"first": "-5 deg", "last": mean, "duration": f"{duration:.9g} s"}
    elif kind == "pitch-pause":
        count = draws.pick(0, 1, 3)
        each = duration / (2 * count + 1)
        motion |= {
            "first": mean,
            "step": "10 deg",
            "last": f"{float(mean.split()[0]) + 10.0 * count:.12g} deg",
        }
        motion |= {"move": f"{each:.9g} s", "pause": f"{each:.9g} s"}
    else:
        motion |= {"mean": mean, "duration": f"{duration:.9g} s"}
        band = {"low": f"{2.0 * slow:.9g} Hz", "high": f"{15.0 * slow * draws.factor(2.0):.9g} Hz"}
        if kind == "buffet":
            motion |= {"rms": draws.text(0.2, "deg", 3.0)} | band
        elif kind == "chirp":
            motion |= {"amplitude": draws.text(5.0, "deg", 3.0)} | band
        else:
            motion |= {"amplitude": draws.text(10.0, "deg", 3.0), "frequency": draws.text(slow, "Hz", 3.0)}
        if kind == "two-tone":
            motion |= {
                "second_amplitude": draws.text(1.0, "deg", 3.0),
                "second_frequency": f"{5.0 * slow:.9g} Hz",
            }
    return motion


def _disturbances(draws):
    found = {}
    shaking = {"low": "8 Hz", "high": "10 Hz"}
    if draws.chance(0.1):
        found["heave"] = shaking | {"rms": draws.text(0.03, "g", 4.0)}
        found["axial"] = shaking | {"rms": draws.text(0.005, "g", 4.0)}
    if draws.chance(0.1):
        found["roll"] = {"amplitude": draws.text(1.0, "deg", 2.0), "frequency": draws.text(2.0, "Hz", 3.0)}
    if draws.chance(0.1):
        found["yaw"] = {"amplitude": draws.text(1.0, "deg", 2.0), "frequency": draws.text(8.0, "Hz", 3.0)}
    if draws.chance(0.1):
        found |= {"spikes": f"{draws.log(1e-3, 0.9):.6f}", "spike": draws.text(0.5, "g", 6.0)}
    if draws.chance(0.1):
        found["dropouts"] = f"{draws.rng.random():.4f}"
    if draws.chance(0.1):
        found |= {
            "gyro_delay": draws.text(2.0, "ms"),
            "gyro_scale": draws.text(0.1, "%"),
            "bandwidth": "30 Hz",
        }
    if draws.chance(0.1):
        found |= {"pivot": draws.text(1.0, "mm"), "common_delay": draws.text(1.0, "ms")}
    return found


def _estimator(draws):
    found = {"states": draws.pick(8, 11, 15, 19), "smooth": draws.chance(0.3)}
    if draws.chance(0.3):
        found["gate"] = draws.pick(1.0, 4.0, 25.0, 1e3, 1e300)
    if draws.chance(0.3):
        found["snap"] = f"{1e7 * draws.factor(12.0):.6g} rad^2/s^7"
    return found


def _prior(draws):
    found = {
        "lever_common": draws.text(3.0, "mm", 4.0),
        "lever": draws.text(1.0, "mm", 4.0),
        "height": draws.text(5.0, "mm", 4.0),
        "gyro_scale": draws.text(0.1, "%", 6.0),
        "gyro_delay": draws.text(5.0, "ms", 6.0),
    }
    for name, frequency in (("heave", 9.0), ("axial", 12.0)):
        if draws.chance(0.5):
            found[name] = {
                "frequency": draws.text(frequency, "Hz", 5.0),
                "damping": f"{draws.rng.uniform(1e-6, 0.999999):.9f}" if draws.absurd() else "0.3",
                "level": draws.text(0.01, "g", 8.0),
            }
    return found
