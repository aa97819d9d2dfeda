"""Damaged logs of odd forms are recognised and read, or refused in one sentence; nothing else is raised."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from inercal.foundation.errors import InputError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map

sys.path.insert(0, str(Path(__file__).parents[1] / "records"))
from line_variants import ACC, GYRO, VARIANTS, T
from test_more_formats import GCSV, columns, objects

SEED, SHORT, CASES, ROWS = 20261127, 5, 3000, 150
TABLE = np.column_stack([1000 * T, GYRO / 0.0005, ACC / 0.00098]).round().astype(int)[:ROWS]
LOGS = {
    "objects.json": json.dumps(objects()[:ROWS]),
    "columns.json": json.dumps({name: values[:ROWS] for name, values in columns().items()}, indent=1),
    "log.gcsv": GCSV + "\n".join(",".join(map(str, row)) for row in TABLE) + "\n",
    "novatel.asc": "".join(
        f"#RAWIMUA,COM1,0,81.5,FINESTEERING,2260,1.0,02000020,3fd1,16809;2260,{row[0]},00000077,"
        f"{','.join(map(str, row[1:]))}*d8bf93fa\n"
        for row in TABLE
    ),
    "wide.csv": "\n".join(",".join(map(str, column)) for column in TABLE.T) + "\n",
    "lines.txt": "\n".join(VARIANTS["json nested"][0].split("\n")[:ROWS]) + "\n",
    "documents.txt": "\n".join(VARIANTS["documents"][0].split("\n")[: 12 * ROWS]) + "\n",
    "words.txt": "\n".join(VARIANTS["words three lines"][0].split("\n")[: 3 * ROWS]) + "\n",
    "stamps.csv": "\n".join(VARIANTS["iso zone"][0].split("\n")[:ROWS]) + "\n",
    "rates.csv": "rate [deg/s],output [V]\n"
    + "\n".join(f"{k},{2.5 + 0.01 * k}" for k in range(-9, 10))
    + "\n",
}


def spoiled(rng, data):
    """Bytes with one to three accidents: cut, lost, doubled, flipped, or filled with others."""
    for _ in range(int(rng.integers(1, 4))):
        at, length = int(rng.integers(len(data) + 1)), int(rng.integers(1, 40))
        match int(rng.integers(6)):
            case 0:
                data = data[: max(at, 1)]
            case 1:
                data = data[:at] + data[at + length :]
            case 2:
                data = data[:at] + data[at : at + length] * 3 + data[at + length :]
            case 3:
                data = (
                    data[:at] + bytes([data[at % len(data)] ^ (1 << int(rng.integers(8)))]) + data[at + 1 :]
                )
            case 4:
                data = data[:at] + rng.bytes(length) + data[at:]
            case _:
                data = data[:at] + b"\0" * length + data[at + length :]
        data = data or b"\n"
    return data


@pytest.mark.parametrize(
    "cases",
    [range(SHORT), pytest.param(range(SHORT, CASES), marks=pytest.mark.campaign)],
    ids=["short", "full"],
)
@pytest.mark.parametrize("name", LOGS)
def test_a_damaged_log_is_read_or_refused(name, cases, tmp_path):
    path, place = tmp_path / name, tmp_path / "map.toml"
    for number in cases:
        rng = np.random.default_rng([SEED, len(name), number])
        path.write_bytes(spoiled(rng, LOGS[name].encode()))
        said = ""
        try:
            place.write_text(guess_map(path, on_table=name == "rates.csv"), encoding="utf-8")
            record_map = read_map(place)
            record_map.refuse_guess()
            read(path, record_map, counted=True)
        except InputError as error:
            said = str(error)
        assert "\n" not in said
