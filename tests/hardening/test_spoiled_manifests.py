"""Spoiled manifests of fleets: read, or refused in one sentence; never anything else, and never a file elsewhere."""

import random

import pytest

from inercal.errors import InputError
from inercal.fleet.manifest import read_manifest
from inercal.fleet.unit import result_path, row_path

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
