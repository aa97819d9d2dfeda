"""The study that ``inercal new imu`` writes: complete, commented, loadable, honest where unedited."""

import math
import re
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from inercal.study.load import load_imu_study
from inercal.study.schema import json_schema
from inercal.study.template import imu_template

KEY = re.compile(r"(?:# )?(\w+) = (.*\S)  +# (.+)")


def load(tmp_path, text):
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    return load_imu_study(path)


def uncommented(text):
    return re.sub(r"^# (\w+ = )", r"\1", text, flags=re.MULTILINE)


def test_it_loads_as_written_and_fits_the_schema(tmp_path):
    study = load(tmp_path, imu_template())
    assert study.site.latitude == pytest.approx(math.radians(45.0))
    Draft202012Validator(json_schema()).validate(tomllib.loads(imu_template()))


def test_unedited_its_gravity_is_that_of_anywhere_on_earth(tmp_path):
    site = load(tmp_path, imu_template()).site
    u = math.hypot(*(each.u * each.sensitivity for each in site.inputs))
    assert site.gravity - 2 * u < 9.780 < 9.832 < site.gravity + 2 * u
    assert u < 0.03


def test_every_key_is_there_and_loads_when_uncommented(tmp_path):
    text = uncommented(imu_template())
    study = load(tmp_path, text)
    assert study.static_start == 50.0
    for name, table in json_schema()["$defs"].items():
        given = tomllib.loads(text)
        if name != "ImuStudyFile":
            given = given[name.removesuffix("Table").lower()]
        assert list(given) == list(table["properties"])


def test_every_key_and_table_has_its_comment_on_the_line():
    body = imu_template().partition("schema = 1")
    for line in (body[1] + body[2]).splitlines():
        assert len(line) <= 110
        assert not line or line.startswith("[") or KEY.fullmatch(line), line
        assert not line.startswith("[") or re.fullmatch(r"\[\w+\]  +# \S.*", line)


def test_the_header_names_the_next_command():
    assert "# Next: inercal calibrate imu RECORD.csv --study" in imu_template()
    assert "# Next: inercal calibrate imu 'run 1.csv' b.csv --study" in imu_template(
        [Path("run 1.csv"), "b.csv"]
    )
    assert "# Next: inercal calibrate imu a.csv --map my-map.toml --study my.toml\n" in imu_template(
        ["a.csv"], "my.toml", "my-map.toml"
    )


@pytest.mark.parametrize("name", ["a\nb = 1", "a\x00b", "a\udcffb", "{records}", "a\u2028b"])
def test_odd_file_names_stay_in_their_comment(tmp_path, name):
    load(tmp_path, imu_template([name]))
