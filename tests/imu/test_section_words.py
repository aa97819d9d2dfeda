"""What names say of sections, on names that people use: see the list beside the data of the tests."""

import csv
from pathlib import Path

import pytest

from inercal.foundation.units import parse_quantity
from inercal.systems.imu.sections.cutting.words import claim

NAMES = Path(__file__).parents[1] / "data" / "sections" / "names.csv"


@pytest.mark.parametrize("half", ["seen", "blind"])
def test_names_say_what_people_mean_by_them(half):
    """The rules were written on the half called seen; of the 57 others 56 were read rightly at the first look, and one
    was mended after it (``25degC`` taken for an angle)."""
    wrong = []
    for row in csv.DictReader(NAMES.read_text(encoding="utf-8").splitlines()):
        if row["half"] == half:
            said = claim(row["name"])
            dimension = "rate" if row["kind"] == "rate" else "angle"
            value = parse_quantity(row["value"], dimension, row["name"]).value if row["value"] else None
            expected = (row["kind"], row["up"], row["axis"], pytest.approx(value) if value else None)
            if (said.kind, said.up, said.axis, said.rate if said.kind == "rate" else said.angle) != expected:
                wrong.append(f"{row['name']}: {said}")
    assert wrong == []


def test_the_own_name_of_a_file_goes_before_that_of_its_folder():
    assert claim("z_down/x_up.csv").up == "+x"
    assert claim("x_up/z_down/log.csv").up == "-z"


@pytest.mark.parametrize("axis", "xyz")
def test_the_sign_may_stand_before_or_behind_the_axis(axis):
    for name in ("{}_neg", "neg_{}", "{}neg", "neg{}", "-{}", "{}-", "{}_minus", "minus {}", "{} axis down"):
        assert claim(name.format(axis)).up == f"-{axis}", name
