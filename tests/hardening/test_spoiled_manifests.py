"""Spoiled manifests of fleets: read, or refused in one sentence; never anything else, and never a file elsewhere.

So for what their cells say: keys of the study and addresses of files that nobody would type end as a row.
"""

import random

import pytest
from independent.fleet import made

from inercal.foundation.errors import InputError
from inercal.laboratory.fleet.manifest import FleetUnit, read_manifest
from inercal.laboratory.fleet.unit import FAILED, Batch, result_path, row_path

SOUND = (
    'serial,files,imu.method,conditions.temperature\nSN 001,a.csv,means,21.5 degC\n"SN, 2","b.csv; c.csv",,\n'
    "Größe/3,s3://lab/d.csv,ferraris,\n"
).encode()
PIECES = [
    b"",
    b",",
    b'"',
    b"\n",
    b"\r",
    b"\0",
    b"\xff",
    b";",
    b"../",
    b"\x1b[2J",
    b"=1+1",
    b"x" * 200_000,
    "é".encode(),
]


def spoiled(rng):
    """A manifest with some bytes changed, cut, doubled, or with something put in."""
    data = bytearray(SOUND)
    for _ in range(rng.randint(1, 4)):
        at, to = sorted(rng.choices(range(len(data) + 1), k=2))
        match rng.randrange(4):
            case 0:
                data[at:to] = b""
            case 1:
                data[at:at] = rng.choice(PIECES)
            case 2:
                data[at:at] = data[at:to]
            case 3 if at < len(data):
                data[at] = rng.randrange(256)
    return bytes(data)


def read_or_refused(path):
    """The units, or the sentence of the refusal."""
    try:
        return read_manifest(path), ""
    except InputError as error:
        return (), str(error)


@pytest.mark.parametrize("many", [400, pytest.param(20_000, marks=pytest.mark.campaign)])
def test_spoiled_manifests_are_read_or_refused(tmp_path, many):
    rng, path, read = random.Random(20261123), tmp_path / "fleet.csv", 0
    for _ in range(many):
        path.write_bytes(spoiled(rng))
        units, said = read_or_refused(path)
        assert bool(units) != bool(said)
        if said:
            assert said.startswith(str(path))
            assert "\n" not in said
            assert len(said) < 1000
        read += bool(units)
        for unit in units:
            for place in (row_path(tmp_path, unit.serial), result_path(tmp_path, unit.serial)):
                assert place.parent.parent == tmp_path
                assert len(place.name.encode()) <= 255
    assert 0 < read < many


KEYS = [
    "site.gravity",
    "imu.method",
    "conditions.temperature",
    "item.serial",
    "specification.K1",
    "imu",
    "none.such",
]
VALUES = [
    "9.8(1) m/s^2",
    "means",
    "[",
    "{}",
    "nan",
    "1e999 m/s^2",
    '["a"]',
    "true",
    "=1+1",
    "\x00",
    "9" * 5000,
    "ä",
    '"',
]
ADDRESSES = [
    "memory://lab/..", "memory://", "memory://lab", "memory://lab/a.csv", "file://", "file:///", "://", "::", "gs://a/b",
    "zip://a::memory://lab/a.csv", "reference://", "http://127.0.0.1:1/a.csv", "x://y", "memory://lab/a.csv?b#c",
    "s3://", "nobody@host://a", "memory://" + "a" * 300, "memory://lab/../../a.csv", "data://a", "local://..",
]  # fmt: skip


@pytest.mark.parametrize("many", [60, pytest.param(3000, marks=pytest.mark.campaign)])
def test_whatever_a_cell_says_is_a_row_in_one_sentence(tmp_path, many):
    import fsspec

    lab, out = tmp_path / "lab", tmp_path / "out"
    made(lab, 1)
    for name in ("units", "results"):
        (out / name).mkdir(parents=True)
    fsspec.filesystem("memory").pipe("/lab/a.csv", (lab / "unit000.csv").read_bytes())
    rng, statuses = random.Random(20261125), set()
    for number in range(many):
        files = rng.choices(
            [str(lab / "unit000.csv"), *ADDRESSES], [20, *[1] * len(ADDRESSES)], k=rng.randint(1, 2)
        )
        keys = [f"{rng.choice(KEYS)}={rng.choice(VALUES)}" for _ in range(rng.randrange(3))]
        unit = FleetUnit(f"{number}", tuple(files), tuple(keys))
        row = Batch(lab / "fleet.csv", "", lab / "imu.toml", None, out)._row(unit)
        statuses.add(row.status)
        assert row.status != FAILED, (unit, row)
        assert "\n" not in row.message
        assert row.message
    assert {"ok", "refused"} <= statuses
    assert {path.name for path in tmp_path.iterdir()} == {"lab", "out"}
    assert {path.name for path in lab.iterdir()} == {"fleet.csv", "imu.toml", "unit000.csv"}
