"""Studies of a turntable for the tests, and the table of the paper written out once more by hand."""

import numpy as np

from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.instruments.by_angle import CHANNELS, EXTRA, channel_model
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid, named
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.settings import Instrument, PositionDesign, TurntableSettings

ARCMIN = np.radians(1.0 / 60.0)
DEG_H = parse_unit("deg/h").factor
GRAVITY, LATITUDE = 9.8, np.radians(39.1)

#: typical drift of a gyrowheel [deg/h] for axis X, and another for Y
DRIFT_X = {"F": 50.0, "X": 60.0, "Y": 40.0, "Z": 8.0, "XX": 2.0, "YY": 1.5, "XY": 1.0, "XZ": 3.0, "YZ": 2.5}
DRIFT_Y = {
    "F": -20.0,
    "X": 35.0,
    "Y": -55.0,
    "Z": 5.0,
    "XX": -1.0,
    "YY": 2.5,
    "XY": 2.0,
    "XZ": -1.5,
    "YZ": 3.5,
}
WHEEL_X = {f"DX_{name}": value * DEG_H for name, value in DRIFT_X.items()} | {
    "k_x": 1.01,
    "k_y": -0.02,
    "k_z": 0.01,
}
WHEEL = (
    WHEEL_X
    | {f"DY_{name}": value * DEG_H for name, value in DRIFT_Y.items()}
    | {"kY_x": 0.015, "kY_y": 0.99, "kY_z": -0.01}
)

FULL_RANK = grid((6, 6))
TUMBLE = named("24-position")


def table(half_width=2.0 * ARCMIN, **more):
    """The two-axis table, each error uniform on that half width; none of them if it is 0."""
    return turntable("two_axis_turntable", uniform(half_width) if half_width else None, **more)


def study(
    plan=FULL_RANK, chain=None, site=None, kind="gyrowheel", unit="deg/h", coefficients=WHEEL, **instrument
):
    """Settings of a study; errors of the table only where a chain has them."""
    return TurntableSettings(
        site=site or Site(GRAVITY, (), LATITUDE),
        rig="two_axis_turntable",
        chain=chain or table(0.0),
        plan=plan,
        design=PositionDesign(grid((36, 36))),
        instrument=Instrument(kind=kind, unit=parse_unit(unit), coefficients=coefficients, **instrument),
    )


def usual_terms(kind):
    """Terms that are estimated where a study says nothing, channel after channel."""
    return [s for name in CHANNELS[kind] for s in channel_model(kind, name).without(EXTRA).symbols]


def rotated(row, axis, angle):
    """Row vectors times an elementary rotation, by components: ``row Rx(t)`` and so on."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = row
    if axis == "x":
        return x, c * y + s * z, c * z - s * y
    if axis == "y":
        return c * x - s * z, y, c * z + s * x
    return c * x + s * y, c * y - s * x, z


#: the two-axis table of Zhao et al. 2023: joints by their number, errors by their name
CHAIN = (
    ("y", 0),
    ("y", "dphi_y1"),
    ("x", "dalpha_x1"),
    ("z", "dalpha_z1"),
    ("x", "deps_x"),
    ("y", "deps_y"),
    ("z", 1),
    ("z", "dphi_z2"),
    ("x", "dalpha_x2"),
    ("y", "dalpha_y2"),
    ("x", "dtheta_x"),
    ("y", "dtheta_y"),
    ("z", "dtheta_z"),
)


def references(angles, errors, latitude=LATITUDE):
    """a (unit gravity) and w [rad/s] on the instrument's axes, each three arrays, by that chain."""
    a = (0.0, 0.0, -1.0)
    w = (EARTH_RATE * np.cos(latitude), 0.0, EARTH_RATE * np.sin(latitude))
    for axis, what in CHAIN:
        angle = angles[..., what] if isinstance(what, int) else errors.get(what, 0.0)
        a, w = rotated(a, axis, angle), rotated(w, axis, angle)
    return a, w


def wheel_output(axis, c, a, w):
    """Output of one axis of a gyrowheel, the equation written out."""
    k, D = {"x": ("k", "DX"), "y": ("kY", "DY")}[axis]
    drift = c[f"{D}_F"] + sum(c[f"{D}_{i}"] * a[j] for j, i in enumerate("XYZ"))
    for first, second in ("XX", "YY", "ZZ", "XY", "XZ", "YZ"):
        drift = drift + c.get(f"{D}_{first}{second}", 0.0) * a["XYZ".index(first)] * a["XYZ".index(second)]
    return drift + sum(c[f"{k}_{i}"] * w[j] for j, i in enumerate("xyz"))


def codes_of(estimate):
    """Codes of the findings but those of what no test would show, which most plans have."""
    usual = ("blind", "stated_exact")
    return [finding.code for finding in estimate.findings if finding.code not in usual]


def u_without_doubts(estimate):
    """u (p,) without faults that are not excluded: by noise, table and what is stated."""
    doubtful = [item.share for item in estimate.budget if "not excluded" in item.source]
    share = np.array([sum(each.get(name, 0.0) for each in doubtful) for name in estimate.names])
    return estimate.u * np.sqrt(1.0 - share)
