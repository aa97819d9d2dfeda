"""Calibrations from pose means, known rates and known turns by simulators of plain NumPy, and K2 in the hand.

For campaigns that ask whether the stated uncertainties are true, and for tests.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from campaigns import imu as by_hand
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import (
    Disturbances,
    ImuSettings,
    KnownRatesSettings,
    KnownTurnsSettings,
    MeansSettings,
)
from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate
from inercal.systems.imu.task import calibrate, calibrate_files
from inercal.systems.imu.task import calibrate as calibrate_imu

G = 9.81
SITE = Site(G, (GravityInput("gravity", 2e-4, "m/s^2", 1.0),), 0.8, 0.0)
RPM = np.pi / 30.0
RATES, RATES_U = RPM * np.array([0.0, 33.333, 45.0]), RPM * np.array([0.0, 0.015, 0.02])
ANGLES, ANGLES_U = np.radians([361.338, 367.160, 363.670]), np.radians([0.05, 0.05, 0.05])
TILT = np.radians(0.1)


def record_of(sensor, values, t=None, unit="count"):
    """A record of one triad (n, 3), its rows counted where there is no time."""
    t = np.arange(len(values), dtype=float) if t is None else t
    source = Source("made", "")
    columns = [
        Column(f"{sensor}_{axis}", parse_unit(unit), np.ascontiguousarray(column), t, source)
        for axis, column in zip("xyz", values.T, strict=True)
    ]
    return Record({column.name: column for column in columns}, (), (source,))


def directions(rng, n):
    x = rng.normal(size=(n, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def triad(rng, scale):
    """True bias, scale and upper misalignments (9,), and the outputs for inputs (n, 3)."""
    truth = np.concatenate(
        [100.0 * rng.normal(size=3), scale * (1 + 0.02 * rng.normal(size=3)), 0.01 * rng.normal(size=3)]
    )
    M = np.array([[1.0, truth[6], truth[7]], [0.0, 1.0, truth[8]], [0.0, 0.0, 1.0]])
    return truth, lambda x: x @ (truth[3:6, None] * M).T + truth[:3]


def pose_means(rng, n=24, noise=0.3, k2=0.0):
    truth, outputs = triad(rng, 400.0)
    gravity = G + 2e-4 * rng.normal()
    y = outputs(gravity * directions(rng, n))
    along = (y - truth[:3]) / truth[3:6]
    return truth, y + truth[3:6] * k2 * along**2 + noise * rng.normal(size=(n, 3))


def platter(rng, noise=0.5, wow=1e-4, off=(0.0, 0.0, 0.0), orientations=(6, 15, 15)):
    """Truth, and the rows of each rate, whose true values are off by what is stated and a relative ``off`` more."""
    truth, outputs = triad(rng, 4000.0)
    rows = []
    for rate, u, more, n in zip(RATES, RATES_U, off, orientations, strict=True):
        true = (rate + u * rng.normal()) * (1.0 + more)
        x = true * (1.0 + wow * rng.normal(size=(n, 1))) * directions(rng, n)
        rows.append(outputs(x) + noise * rng.normal(size=(n, 3)))
    return truth, rows


def turns(rng, tilt=TILT, drift=0.0, noise=2.0):
    """Truth (12,) and recordings of 16 s at 100 Hz, each with a turn of 6 s after 5 s."""
    scale = 940.0 * (1 + 0.02 * rng.normal(size=3))
    T = np.where(np.eye(3) > 0, 1.0, 0.01 * rng.normal(size=(3, 3)))
    bias = 20.0 * rng.normal(size=3)
    t = np.arange(0.0, 16.0, 0.01)
    profile = np.where((t > 5.0) & (t < 11.0), 1.0 - np.cos(2.0 * np.pi * (t - 5.0) / 6.0), 0.0) / 6.0
    records = []
    for j in range(3):
        axis = np.eye(3)[j] + tilt * rng.normal(size=3) * (np.arange(3) != j)
        rate = (ANGLES[j] + ANGLES_U[j] * rng.normal()) * np.outer(profile, axis / np.linalg.norm(axis))
        output = (
            rate @ (scale[:, None] * T).T + bias + drift * t[:, None] + noise * rng.normal(size=rate.shape)
        )
        records.append(record_of("gyro", output, t))
    off_diagonal = [T[i, j] for i in range(3) for j in range(3) if i != j]
    return np.concatenate([bias + 8.0 * drift, scale, off_diagonal]), records


def by_means(values, **more):
    return calibrate(record_of("acc", values), ImuSettings(SITE, method=MeansSettings(), **more)).estimate


def by_rates(rows, rates=RATES, u=RATES_U, **more):
    records = [record_of("gyro", each) for each in rows]
    return calibrate_files(
        records, ImuSettings(SITE, method=KnownRatesSettings(tuple(rates), tuple(u)), **more)
    ).estimate


def by_turns(records, alignment=TILT):
    options = KnownTurnsSettings(tuple(ANGLES), tuple(ANGLES_U), alignment)
    return calibrate_files(records, ImuSettings(SITE, method=options)).estimate


def drawn(method, rng):
    """The truth of one draw, and its estimate."""
    if method == "means":
        k2 = rng.normal(0.0, LIMITS.ordinary_k2, 3)
        truth, values = pose_means(rng, k2=k2)
        return truth, by_means(values)
    if method == "known_rates":
        truth, rows = platter(rng)
        return truth, by_rates(rows)
    truth, records = turns(rng)
    return truth, by_turns(records)


def _one(method, rng):
    """The errors of one draw, for `inercal.foundation.inference.consistency`."""
    truth, estimate = drawn(method, rng)
    told = slice(len(truth))  # K2 comes last
    return {
        "error": estimate.values[told] - truth,
        "u": estimate.u[told],
        "dof": estimate.dof[told],
        "sound": np.array(float(estimate.status is Status.OK)),
    }


def one_of_means(rng):
    """Rows of 24 poses, K2 of the accelerometers drawn as is ordinary."""
    return _one("means", rng)


def one_of_known_rates(rng):
    """Rows of 36 orientations at rest and two rates."""
    return _one("known_rates", rng)


def one_of_known_turns(rng):
    """A recording of a turn about each axis."""
    return _one("known_turns", rng)


def one_with_k2(rng, fitted=False):
    """24 or, where K2 is fitted, 36 poses in the hand, K2 of each recording drawn as is ordinary, alike on all axes."""
    k2 = rng.normal(0.0, LIMITS.ordinary_k2)
    truth = draw_truth(rng)
    poses = hand_poses(rng, 36 if fitted else 24)
    disturbed = Disturbances(k2=k2)
    record, truth = simulate(truth, poses, G, by_hand.LATITUDE, rng, rate=50.0, disturbances=disturbed)
    settings = replace(ImuSettings(Site(G, (), by_hand.LATITUDE)), k2=fitted)
    estimate = calibrate_imu(record, settings).estimate
    true = truth.values() | {f"K2_{axis}": k2 for axis in "xyz"}
    return {
        "error": estimate.values - np.array([true[name] for name in estimate.names]),
        "u": estimate.u,
        "dof": estimate.dof,
        "sound": np.array(float(estimate.status is Status.OK)),
    }


def one_with_k2_fitted(rng):
    """As `one_with_k2`, with K2 fitted."""
    return one_with_k2(rng, fitted=True)
