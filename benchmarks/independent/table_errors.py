"""Do the intervals hold where a table errs as tables do? Tests simulated without any of the program's own code.

    python benchmarks/independent/table_errors.py --runs 2000 --case angle

The rig is written out here once more: rotations by Rodrigues' formula, frames north, west, up. Each run draws a
table and an instrument, writes a record, and has the program calibrate it by a study that tells tolerances and
certificates, nothing of the truth. Results are kept in docs/uncertainty/turntable.md.
"""

import argparse
import math
import os
import tempfile
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

SEED = 20261122
ARCSEC = math.radians(1.0 / 3600.0)
DEG_H = math.radians(1.0) / 3600.0
EARTH = 7.292115e-5 / DEG_H
LATITUDE = math.radians(39.1)
GRAVITY = 9.8
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

#: joint or error, its axis, and the joint whose angle it follows; base first
TABLE = (
    ("phi1", "y", 0), ("dphi_y1", "y", 0), ("dalpha_x1", "x", 0), ("dalpha_z1", "z", 0),
    ("deps_x", "x", 0), ("deps_y", "y", 0), ("phi2", "z", 1), ("dphi_z2", "z", 1),
    ("dalpha_x2", "x", 1), ("dalpha_y2", "y", 1),
    ("dtheta_x", "x", 1), ("dtheta_y", "y", 1), ("dtheta_z", "z", 1),
)  # fmt: skip
TUMBLE = [(45 * k, 0) for k in range(8)] + [(45 * k, 90) for k in range(8)] + [(90, 45 * k) for k in range(8)]
GRID = [(30 + 60 * i, 30 + 60 * j) for i in range(6) for j in range(6)]

WHEEL = {"F": 50.0, "X": 60.0, "Y": 40.0, "Z": 8.0, "XX": 2.0, "YY": 1.5, "XY": 1.0, "XZ": 3.0, "YZ": 2.5}

#: case -> positions [deg], errors of the study, noise of a reading, instrument
CASES: dict[str, dict[str, Any]] = {
    # the tumble six times: what belongs to an angle does not average out
    "angle": {
        "positions": TUMBLE * 6,
        "errors": {
            name: {"normal": 60.0, "scope": "angle"}
            for name in ("dphi_y1", "dphi_z2", "dalpha_x1", "dalpha_z1", "dalpha_x2", "dalpha_y2")
        }
        | {name: {"normal": 20.0} for name in ("deps_x", "deps_y", "dtheta_x", "dtheta_y", "dtheta_z")},
        "noise": 0.005,
    },
    "harmonics": {
        "positions": GRID,
        "errors": {
            "dphi_y1": {"harmonics": {1: 120.0, 2: 60.0}, "normal": 5.0},
            "dphi_z2": {"harmonics": {1: 100.0, 3: 50.0}, "normal": 5.0},
            "dalpha_x2": {"harmonics": {1: 60.0}},
            "dtheta_x": {"normal": 20.0},
        },
        "noise": 0.003,
    },
    # what a certificate says: value, a table over the angle, a harmonic of known phase
    "measured": {
        "positions": GRID,
        "errors": {
            "deps_x": {"value": (150.0, 10.0)},
            "deps_y": {"value": (-80.0, 15.0)},
            "dtheta_y": {"value": (300.0, 20.0)},
            "dphi_z2": {"table": (90.0, 8.0), "normal": 5.0},
            "dphi_y1": {"known": (2, 120.0, 10.0, 30.0, 4.0), "normal": 5.0},
        },
        "noise": 0.003,
    },
    # squares of large errors against a small noise [ug]
    "large": {
        "positions": TUMBLE,
        "errors": {name: {"uniform": 600.0} for name, _, _ in TABLE if not name.startswith("phi")},
        "noise": 2.0,
        "instrument": "accelerometer",
    },
}


def turned(axis: str, angle: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) by Rodrigues' formula, columns the new axes."""
    x, y, z = AXES[axis]
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1.0 - c) * (K @ K)


def drawn(
    rng: np.random.Generator, errors: dict[str, Any], phi: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """True errors (n,) [rad] by name at angles (n, 2) [deg], and measured tables by name: angle, error, u."""
    truth, tables = {}, {}
    for name, _, joint in TABLE:
        says = errors.get(name)
        if says is None:
            continue
        n, own = len(phi), phi[:, joint]
        e = np.zeros(n)
        if "normal" in says or "uniform" in says:
            per_position = name.startswith(("dphi", "dalpha"))
            keys = own if says.get("scope") == "angle" else np.arange(n) if per_position else np.zeros(n)
            for key in np.unique(keys):
                unit = rng.standard_normal() if "normal" in says else rng.uniform(-1.0, 1.0)
                e[keys == key] += unit * says.get("normal", says.get("uniform"))
        for order, amplitude in says.get("harmonics", {}).items():
            a, b = amplitude * rng.standard_normal(2)
            e += a * np.cos(np.radians(order * own)) + b * np.sin(np.radians(order * own))
        if "value" in says:
            value, u = says["value"]
            e += value + u * rng.standard_normal()
        if "known" in says:
            order, amplitude, u, phase, u_phase = says["known"]
            phase_true = np.radians(phase + u_phase * rng.standard_normal())
            e += (amplitude + u * rng.standard_normal()) * np.sin(np.radians(order * own) + phase_true)
        if "table" in says:
            size, u = says["table"]
            nodes = np.arange(0.0, 360.0, 30.0)
            true = size * rng.standard_normal(len(nodes))
            tables[name] = np.column_stack(
                [nodes, true + u * rng.standard_normal(len(nodes)), np.full(len(nodes), u)]
            )
            e += true[(np.round(own / 30.0).astype(int)) % 12]
        truth[name] = e * ARCSEC
    return truth, tables


def attitude(phi: np.ndarray, truth: dict[str, np.ndarray]) -> np.ndarray:
    """True attitudes (n, 3, 3): columns are the instrument's axes in north, west, up."""
    C = np.broadcast_to(np.eye(3), (len(phi), 3, 3))
    for name, axis, joint in TABLE:
        if name.startswith("phi"):
            C = C @ turned(axis, np.radians(phi[:, joint]))
        elif name in truth:
            C = C @ turned(axis, truth[name])
    return C


def wheel(rng: np.random.Generator, C: np.ndarray) -> tuple[dict[str, float], np.ndarray]:
    """True coefficients [deg/h] of an axis of a gyrowheel, drawn, and its readings (n,) [deg/h]."""
    D = {name: value * (1.0 + 0.5 * rng.standard_normal()) for name, value in WHEEL.items()}
    k = np.array([1.0, 0.0, 0.0]) + 0.02 * rng.standard_normal(3)
    down = -C[:, 2, :]
    w = EARTH * (math.cos(LATITUDE) * C[:, 0, :] + math.sin(LATITUDE) * C[:, 2, :])
    at = dict(zip("XYZ", down.T, strict=True))
    y = w @ k
    for name, value in D.items():
        y = y + value * math.prod([at[letter] for letter in name if letter != "F"], start=np.ones(len(C)))
    return {f"DX_{name}": value for name, value in D.items()} | dict(
        zip(("k_x", "k_y", "k_z"), k, strict=True)
    ), y


def accelerometers(rng: np.random.Generator, C: np.ndarray) -> tuple[dict[str, float], np.ndarray]:
    """True biases and scale factors of three accelerometers, drawn, and their readings (n, 3) [m/s^2]."""
    f = GRAVITY * C[:, 2, :]
    K0, K1 = 1e-3 * rng.standard_normal(3), 1.0 + 1e-3 * rng.standard_normal(3)
    M = np.eye(3) + 1e-3 * rng.standard_normal((3, 3)) * (1.0 - np.eye(3))
    truth = {f"K0_{i}": K0[k] for k, i in enumerate("xyz")} | {f"K1_{i}": K1[k] for k, i in enumerate("xyz")}
    truth |= {f"M_{i}{j}": M[a, b] for a, i in enumerate("xyz") for b, j in enumerate("xyz") if i != j}
    return truth, K0 + K1 * (f @ M.T)


def study(case: dict[str, Any], tables: dict[str, Any], folder: Path) -> str:
    """The study of a case; measured tables are written beside it."""
    lines = [
        f'site = {{ latitude = "39.1 deg", gravity = "{GRAVITY} m/s^2" }}',
        '[rig]\nkind = "two_axis_turntable"',
    ]
    lines.append("[rig.errors]")
    for name, says in case["errors"].items():
        keys = [f'{kind} = "{says[kind]} arcsec"' for kind in ("normal", "uniform") if kind in says]
        keys += [f'scope = "{says["scope"]}"'] if "scope" in says else []
        if "value" in says:
            keys.append('value = "{} ± {} arcsec", certificate = "K-1"'.format(*says["value"]))
        if name in tables:
            rows = "\n".join(",".join(map(repr, map(float, row))) for row in tables[name])
            (folder / f"{name}.csv").write_text(f"angle [deg],error [arcsec],u [arcsec]\n{rows}\n")
            keys.append(f'table = "{name}.csv", certificate = "K-2"')
        harmonics = [
            f'{{ order = {k}, amplitude = "{a} arcsec" }}' for k, a in says.get("harmonics", {}).items()
        ]
        if "known" in says:
            order, a, u, phase, u_phase = says["known"]
            harmonics.append(
                f'{{ order = {order}, amplitude = "{a} ± {u} arcsec", phase = "{phase} ± {u_phase} deg" }}'
            )
        keys += [f"harmonics = [{', '.join(harmonics)}]"] if harmonics else []
        lines.append(f"{name} = {{ {', '.join(keys)} }}")
    if case.get("instrument") == "accelerometer":
        terms = [f"{term}_{i}" for term in ("K0", "K1") for i in "xyz"]
        terms += [f"M_{i}{j}" for i in "xyz" for j in "xyz" if i != j]
        noise = f'kind = "accelerometer"\nterms = {terms!r}\nnoise = "{case["noise"]} ug"\nunit = "m/s^2"'
    else:
        earth_rate = "stated" if len(case["positions"]) % 24 == 0 else "fitted"
        noise = f'unit = "deg/h"\nnoise = "{case["noise"]} deg/h"\nearth_rate = "{earth_rate}"'
    lines.append(f"[instrument]\n{noise}")
    return "\n".join(lines) + "\n"


def one_test(case_name: str, seed: int, plain: dict[str, str] | None = None) -> dict[str, Any]:
    """One simulated test, calibrated: errors over u by name, and the status.

    ``plain`` replaces texts of the study: what a study without some of its words would have given.
    """
    import inercal as ic

    case, rng = CASES[case_name], np.random.default_rng([SEED, seed])
    phi = np.array(case["positions"], dtype=float)
    errors, tables = drawn(rng, case["errors"], phi)
    C = attitude(phi, errors)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = study(case, tables, folder)
        if case.get("instrument") == "accelerometer":
            truth, y = accelerometers(rng, C)
            y = y + case["noise"] * 9.80665e-6 * rng.standard_normal(y.shape)
            columns, head = y, "acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]"
        else:
            truth, y = wheel(rng, C)
            columns, head = (y + case["noise"] * rng.standard_normal(len(y)))[:, None], "y_x [deg/h]"
            if "stated" in text:
                k = "\n".join(f"{s} = {truth[s]!r}" for s in ("k_x", "k_y", "k_z"))
                text += f"[instrument.coefficients]\n{k.replace('np.float64(', '').replace(')', '')}\n"
        for old, new in (plain or {}).items():
            text = text.replace(old, new)
        rows = np.column_stack([np.arange(1, len(phi) + 1), phi, columns])
        record = folder / "record.csv"
        np.savetxt(
            record,
            rows,
            delimiter=",",
            fmt="%.15g",
            header=f"position [1],phi1 [deg],phi2 [deg],{head}",
            comments="",
        )
        (folder / "study.toml").write_text(text)
        estimate = ic.calibrate(ic.read(record), folder / "study.toml").estimate
    u = np.sqrt(np.diag(estimate.covariance)) if len(estimate.names) else []
    unit = {name: DEG_H if name.startswith("D") else 1.0 for name in estimate.names}
    z = {
        name: (value - truth[name] * unit[name]) / each
        for name, value, each in zip(estimate.names, estimate.values, u, strict=True)
    }
    return {"status": estimate.status.value, "z": z, "findings": [f.code for f in estimate.findings]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--case", choices=CASES, action="append")
    options = parser.parse_args()
    for case in options.case or CASES:
        tests = [one_test(case, seed) for seed in range(options.runs)]
        fitted = [test["z"] for test in tests if test["z"]]
        ok = sum(test["status"] == "ok" for test in tests)
        print(f"{case}: {options.runs} tests, {ok} ok")
        for name in fitted[0] if fitted else ():
            z = np.array([each[name] for each in fitted])
            print(
                f"  {name:8} covered {100.0 * np.mean(np.abs(z) < 1.96):6.2f} %   rms {np.sqrt(np.mean(z**2)):.3f}"
            )
        z = np.array([list(each.values()) for each in fitted] or [[np.nan]])
        print(
            f"  all      covered {100.0 * np.mean(np.abs(z) < 1.96):6.2f} %   rms {np.sqrt(np.mean(z**2)):.3f}"
        )


if __name__ == "__main__":
    main()
