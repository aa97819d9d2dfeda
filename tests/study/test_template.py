"""The studies that ``inercal new`` writes: complete, commented, loadable, honest where unedited."""

import math
import re
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from inercal.rigs.tables import slots
from inercal.studies.load import load_imu_study
from inercal.studies.schema import json_schema
from inercal.studies.template import imu_template, turntable_template
from inercal.studies.turntable import turntable_study
from inercal.units import parse_unit
from rows import for_each

KEY = re.compile(r"(?:# )?(\w+) = (.*\S) +# (.+)")
SCHEMA = json_schema()
INSTRUMENTS = {
    "wheel": {"y_x": parse_unit("deg/h")},
    "wheel in counts": {"position": parse_unit("1"), "y_y": parse_unit("count")},
    "pure numbers": {"y_x": parse_unit("1"), "y_y": parse_unit("1")},
    "gyro": {"gyro_z": parse_unit("deg/s")},
    "gyro in volts": {"rate": parse_unit("deg/s"), "gyro_y": parse_unit("V"), "acc_x": parse_unit("V")},
    "accelerometers": {
        f"{s}_{i}": parse_unit(u) for s, u in (("gyro", "deg/s"), ("acc", "g")) for i in "xyz"
    },
    "accelerometers guessed": dict.fromkeys(("acc_x", "acc_y", "acc_z")),
    "accelerometer in counts": {"acc_z": parse_unit("count")},
}


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


def of_method(method: str) -> str:
    """The template for a method, with everything taken from its comment that is for it."""
    kept = []
    others = {"ferraris", "aided"} - {method}
    skipped = False
    for line in imu_template().splitlines():
        if found := re.match(r"# \[imu\.(\w+)", line):
            skipped = found[1] in others
        elif line.startswith("[") or (line.startswith("# [") and not found):
            skipped = False
        if not skipped:
            kept.append(re.sub(r"^# (\w+ = |\[)", r"\1", line))
    text = "\n".join(kept).replace('method = "multiposition"', f'method = "{method}"')
    unheeded = {"ferraris": "static_start|g_sensitivity|bias_drift", "aided": "static_start|bias_drift"}.get(
        method
    )
    return re.sub(f"(?m)^({unheeded}) = .*$", "", text) if unheeded else text


@pytest.mark.parametrize("method", ["multiposition", "ferraris", "aided"])
def test_every_key_is_there_and_loads_when_uncommented(tmp_path, method):
    text = of_method(method)
    study = load(tmp_path, text)
    whole = tomllib.loads(text)
    Draft202012Validator(json_schema()).validate(whole)
    assert list(whole) == list(SCHEMA["$defs"]["ImuStudyFile"]["properties"])
    for name, given in whole.items():
        if name not in ("schema", "imu"):
            assert list(given) == list(SCHEMA["$defs"][f"{name.title()}Table"]["properties"])
    if method == "multiposition":
        assert study.static_start == 50.0
        keys = list(SCHEMA["$defs"]["ImuTable"]["properties"])
        assert set(whole["imu"]) == set(keys) - {"ferraris", "aided"}
    else:
        table = "FerrarisTable" if method == "ferraris" else "AidedTable"
        assert set(whole["imu"][method]) == set(SCHEMA["$defs"][table]["properties"])
        assert type(study.method).__name__ == f"{method.title()}Settings"


@pytest.mark.parametrize("template", [imu_template, turntable_template])
def test_every_key_and_table_has_its_comment_on_the_line(template):
    body = template().partition("schema = 1")
    for line in (body[1] + body[2]).splitlines():
        assert len(line) <= 110
        if "= " in line:
            assert KEY.fullmatch(line), line
        elif "[" in line:
            assert re.fullmatch(r"(# )?\[[\w.]+\]  +# \S.*", line), line


def test_the_study_of_a_turntable_loads_as_written_and_fits_the_schema():
    data = tomllib.loads(turntable_template())
    study = turntable_study(data, "t.toml")
    assert (len(study.chain.factors), len(study.plan)) == (11, 1296)
    assert study.site.latitude_u == pytest.approx(math.radians(26.0))
    Draft202012Validator(SCHEMA).validate(data)


def lines_with_keys():
    """(table, line) of every key that is commented out in the study of a turntable."""
    table = ""
    for line in turntable_template().splitlines():
        if found := re.match(r"(?:# )?\[([\w.]+)\]", line):
            table = found[1]
        elif re.match(r"# \w+ = ", line):
            yield table, line


@for_each(("table", "line"), list(lines_with_keys()))
def test_every_key_of_a_turntable_loads_when_uncommented(table, line, tmp_path, monkeypatch):
    text = turntable_template().replace(line, line.removeprefix("# "))
    if table == "rate_test":
        text = text.replace("# [rate_test]", "[rate_test]")
    if table == "positions":  # one of four
        monkeypatch.chdir(tmp_path)
        Path("positions.csv").write_text("phi1 [deg],phi2 [deg]\n1,2\n")
        text = re.sub("(?m)^grid = .*", "", text)
    data = tomllib.loads(text)
    if 'unit = "deg/h"' not in line:
        assert (
            turntable_study(data, "t.toml").given
            != turntable_study(tomllib.loads(turntable_template()), "t.toml").given
        )
    Draft202012Validator(SCHEMA).validate(data)


def test_every_key_of_a_turntable_is_there():
    """Keys of a three-axis table are those of the rig; they are told in words."""
    text = re.sub(r"(?m)^# ((\w+) = |\[)", r"\1", turntable_template())
    text = re.sub(r"(?m)^(plan|list|file) = .*", "", text)
    whole = tomllib.loads(text)
    assert set(whole) == set(SCHEMA["$defs"]["TurntableStudyFile"]["properties"])
    for name, given in whole.items():
        if name in ("schema", "positions"):
            continue
        title = "".join(part.title() for part in name.split("_"))
        assert set(given) == set(SCHEMA["$defs"][f"{title}Table"]["properties"]), name
    factors = [slot.name for slot in slots("two_axis_turntable")]
    assert list(whole["rig"]["errors"]) == ["default", *factors]


@for_each("channels", INSTRUMENTS.values())
def test_the_instrument_is_that_of_the_record_with_examples_in_its_unit(channels):
    """Every example loads, alone and with all others; kind and unit are those of the channels."""
    text = turntable_template(channels=channels)
    table = text[text.index("[instrument]") : text.index("[design]")]
    for line in table.splitlines():
        assert len(line) <= 110
        assert not line or re.fullmatch(r"\[[\w.]+\]  +# \S.*", line) or KEY.fullmatch(line), line
    found = turntable_study(tomllib.loads(text), "t.toml").instrument
    kind = {"y": "gyrowheel", "acc": "accelerometer", "gyro": "gyro"}
    kinds = {kind.get(name.rpartition("_")[0]) for name in channels} - {None}
    assert found.kind == (
        "gyro" if "rate" in channels else "accelerometer" if len(kinds) > 1 else kinds.pop()
    )
    name = next(name for name in channels if kind.get(name.rpartition("_")[0]) == found.kind)
    if channels[name] is not None:
        assert found.unit == channels[name]
    for line in [line for line in table.splitlines() if line.startswith("# ")]:
        one = text.replace(line, line.removeprefix("# "))
        assert one != text
        turntable_study(tomllib.loads(one), "t.toml")
    everything = turntable_study(tomllib.loads(text.replace(table, uncommented(table))), "t.toml").instrument
    assert len(everything.coefficients) == 4
    assert all(symbol.split("_")[-1][0] in (name[-1], *"XFx") for symbol in everything.coefficients)
    assert everything.noise is not None


def test_counts_are_told_to_state_the_response_to_earth_rate():
    text = turntable_template(channels={"y_x": parse_unit("count")})
    assert re.search(r'# k_x = ".* count/\(deg/h\)" +# .*; needed where it is not fitted', text)
    assert 'or "stated", which needs k below' in text
    assert "needed" not in turntable_template()


def test_the_next_command_of_a_turntable():
    assert "# Next: inercal sensitivity t.toml\n" in turntable_template((), "t.toml")
    assert "# Next: inercal calibrate turntable a.csv --study t.toml\n" in turntable_template(
        ["a.csv"], "t.toml"
    )


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
