"""The ring-laser IMU of PSINS stood on a vehicle: what looks like its noise is the vehicle's tilting.

Accelerometers and the integrated gyro see the same small tilts, in means over 10 s. What the gyro sees beyond them is
earth rate and its biases. Site: latitude 34.246048 deg, as the head of the file says.
"""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.records.read import read

EXAMPLES = Path(str(files("inercal"))) / "examples"
LATITUDE = np.radians(34.246048)
BLOCK, INTERVAL = 1000, 0.01
DEG_H, ARCSEC = np.radians(1.0 / 3600.0), np.radians(1.0 / 3600.0)


@pytest.fixture(scope="module")
def seen():
    """Times [s] of blocks, their tilts about x and y by accelerometers, their angles by the gyro, its mean, and up."""
    record = read(EXAMPLES / "lasergyro.txt.gz", EXAMPLES / "lasergyro-map.toml")
    gyro, acc = (record.triad(sensor).values for sensor in ("gyro", "acc"))
    count = len(acc) // BLOCK
    up = acc[: count * BLOCK].reshape(count, BLOCK, 3).mean(axis=1)
    up /= np.linalg.norm(up, axis=1)[:, None]
    # a small turn by (p, q) about x and y carries the vertical, which is near z, by (-q, p)
    tilts = np.column_stack([up[:, 1], -up[:, 0]])
    turned = np.cumsum(gyro, axis=0) * INTERVAL - 0.5 * gyro * INTERVAL
    angles = turned[: count * BLOCK].reshape(count, BLOCK, 3).mean(axis=1)
    t = (np.arange(count) + 0.5) * BLOCK * INTERVAL
    return t, tilts, angles, gyro.mean(axis=0), up.mean(axis=0)


def beyond_tilts(t, tilts, angles):
    """Rates (2,) of what the gyro sees about x and y beyond the tilts, and what is left of it (blocks, 2)."""
    beyond = angles[:, :2] - tilts
    line = np.polyfit(t, beyond, 1)
    return line[0], beyond - np.outer(t, line[0]) - line[1]


def deviation(angles, blocks):
    """Allan deviation of the rate of angles at that many blocks."""
    second = angles[2 * blocks :] - 2.0 * angles[blocks:-blocks] + angles[: -2 * blocks]
    return np.sqrt(np.mean(second**2, axis=0) / 2.0) / (blocks * BLOCK * INTERVAL)


def test_gyro_and_accelerometers_see_the_same_tilts(seen):
    t, tilts, angles, _, _ = seen
    _, left = beyond_tilts(t, tilts, angles)
    assert np.all(tilts.std(axis=0) > 230 * ARCSEC)
    assert np.all(np.ptp(tilts, axis=0) > 750 * ARCSEC)
    assert np.all(left.std(axis=0) < 5.5 * ARCSEC)


def test_without_the_tilts_the_gyro_is_more_than_twenty_times_calmer(seen):
    """At 600 s 0.014 deg/h in place of 0.32 and 0.45, 0.006 deg/sqrt(h) if it were white: the most its own N can be."""
    t, tilts, angles, _, _ = seen
    _, left = beyond_tilts(t, tilts, angles)
    for blocks, factor in ((1, 6), (10, 25), (30, 25)):
        assert np.all(deviation(angles[:, :2], blocks) > factor * deviation(left, blocks))
    assert np.all(deviation(left, 60) < 0.0145 * DEG_H)
    assert np.all(deviation(angles[:, :2], 60) > 0.3 * DEG_H)


def test_the_tilts_explain_most_of_what_earth_rate_lacks(seen):
    """The norm of the means is 0.188 deg/h short; with the tilts taken off, 0.024, the horizontal part 0.008.

    What is left lies along the vertical, where a turn by 0.015 deg in the half hour, a bias or a scale error of 0.4 %
    would all look alike.
    """
    t, tilts, angles, mean, up = seen

    def parts(rate):
        upward = rate @ up / np.linalg.norm(up)
        return np.linalg.norm(rate), np.sqrt(rate @ rate - upward**2), upward

    earth = EARTH_RATE * np.array([1.0, np.cos(LATITUDE), np.sin(LATITUDE)])
    assert (parts(mean) - earth) / DEG_H == pytest.approx([-0.188, -0.211, -0.025], abs=1e-3)
    steady = np.array([*beyond_tilts(t, tilts, angles)[0], mean[2]])
    assert (parts(steady) - earth) / DEG_H == pytest.approx([-0.024, -0.008, -0.031], abs=1e-3)
