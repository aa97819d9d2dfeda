"""The studies that ``inercal new`` writes: complete, commented, loadable, honest where unedited."""

import math
import re
import tomllib
from functools import partial
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from new_studies import filled
from sting_text import calibrated

from inercal.faces.studies.aoa import aoa_study
from inercal.faces.studies.imu import imu_study
from inercal.faces.studies.load import load_study
from inercal.faces.studies.schema import json_schema
from inercal.faces.studies.selfcal import selfcal_study
from inercal.faces.studies.starting import PATHS, POSITIONS
from inercal.faces.studies.strapdown import strapdown_study
from inercal.faces.studies.template import template
from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.errors import StudyError
from inercal.foundation.rigs.tables import slots
from inercal.foundation.units import parse_unit
from inercal.systems.listed import SYSTEMS

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


READ = {
    "imu": imu_study,
    "strapdown": strapdown_study,
    "turntable": turntable_study,
    "selfcal": selfcal_study,
    "aoa": aoa_study,
}
#: tables that hold one of several keys, and what stands beside a key
INSTEAD = {"positions": POSITIONS, "plan": PATHS, "sensors.a1": ("axis", "angle")}


def lines_of(text):
    """(table, whether it is in force, key, line) of every key."""
    table, there = "", True
    for line in text.splitlines():
        if found := re.match(r"(# )?\[([\w.]+)\]", line):
            there, table = found[1] is None, found[2]
        elif found := re.match(r"(?:# )?(\w+) = ", line):
            yield table, there, found[1], line


def commented_keys():
    """Kind, table and line of every key that is commented out in a table that is in force."""
    for kind in READ:
        for table, there, _, line in lines_of(filled(kind)):
            if there and line.startswith("# ") and table != "motion":
                yield kind, table, line


@pytest.mark.parametrize("kind", READ)
def test_filled_in_it_loads_as_written_and_fits_the_schema(kind):
    data = tomllib.loads(filled(kind))
    study = READ[kind](data, "t.toml")
    assert study.site.latitude == pytest.approx(math.radians(45.0))
    assert study.site.latitude_u == pytest.approx(math.radians(26.0))
    Draft202012Validator(SCHEMA).validate(data)


def test_anywhere_in_the_north_its_gravity_is_that_of_anywhere_on_earth():
    site = imu_study(tomllib.loads(filled("imu")), "t.toml").site
    u = math.hypot(*(each.u * each.sensitivity for each in site.inputs))
    assert site.gravity - 2 * u < 9.780 < 9.832 < site.gravity + 2 * u
    assert u < 0.03


@pytest.mark.parametrize("kind", READ)
def test_every_key_and_table_has_its_comment_on_the_line(kind):
    text = template(kind)
    for line in text[text.index("schema = 1") :].splitlines():
        assert len(line) <= 120
        if re.match(r"(# )?\w+ = ", line):
            assert KEY.fullmatch(line), line
        elif line.startswith(("[", "# [")):
            assert re.fullmatch(r"(# )?\[[\w.]+\]  +# \S.*", line), line
        else:
            assert not line or re.fullmatch(r" {36}# \S.*", line), line


def keys_of(schema, path=""):
    """Dotted keys of a schema, tables that a template writes on one line as one key."""
    for key, field in schema["properties"].items():
        inner = SCHEMA["$defs"][field["$ref"].rpartition("/")[2]] if "$ref" in field else {}
        if "properties" in inner and "examples" not in field:
            yield from keys_of(inner, f"{path}{key}.")
        else:
            yield f"{path}{key}"


@pytest.mark.parametrize("kind", READ)
def test_every_key_is_there(kind):
    """All but chains, errors that a table of two axes does not have, more sensors, the laboratory, and a second table
    of the same keys."""
    shown = {f"{table}.{key}".lstrip(".") for table, _, key, _ in lines_of(template(kind))}
    known = set(keys_of(SCHEMA["$defs"][f"{kind.capitalize()}StudyFile"]))
    assert {key for key in shown - known if not key.startswith("instrument.coefficients.")} == set()
    alike = (
        r"sensors\.(a[2-9]|a\d\d|gyro_\w+)\..*|prior\.axial\..*|imu\.aided\.rig\.(errors|base|limits)\..*|"
    )
    alike += r"(imu\.aided\.)?rig\.chain"
    alike += r"|laboratory\..*"  # those of `inercal new lab`
    alike += r"|goal\.(?!DX_F|drift).*|cost\.(?!default|position).*"
    two, three = (
        {slot.name for slot in slots(each)} for each in ("two_axis_turntable", "three_axis_turntable")
    )
    others = {f"rig.errors.{name}" for name in three - two} | {"instrument.coefficients"}
    assert {key for key in known - shown - others if not re.fullmatch(alike, key)} == set()


@pytest.mark.parametrize(("kind", "table", "line"), list(commented_keys()))
def test_every_commented_key_loads_alone(kind, table, line, tmp_path):
    calibrated(tmp_path / "calibration.json", K0_x=(0.0, "g"), K1_x=(1.0, "g/(m/s^2)"), D_F_x=(0.0, "V"),
               S_x=(1.0, "V/(rad/s)"))  # fmt: skip
    (tmp_path / "positions.csv").write_text("phi1 [deg],phi2 [deg]\n1,2\n")
    data = tomllib.loads(filled(kind))
    key = line.split()[1]
    place = data
    for part in filter(None, table.split(".")):
        place = place[part]
    for other in INSTEAD.get(table, ()) if key in INSTEAD.get(table, ()) else ():
        place.pop(other, None)
    place |= tomllib.loads(line.removeprefix("# "))
    if table == "imu" and key in (
        "sections",
        "section",
        "placing",
        "level",
        "misalignment",
        "mounting",
        "frame",
        "clock",
        "g_sensitivity",
    ):
        place["method"] = "sections"
    if (table, key) == ("imu", "rates"):
        place["method"] = "known_rates"
    if (table, key) in (("imu", "turns"), ("imu", "alignment")):
        place |= {"method": "known_turns", "turns": dict.fromkeys("xyz", "360 deg")}
    if key == "channel":
        place["calibration"] = "calibration.json"
    if key == "clip":
        data["sensors"]["a1"]["range"] = "2 g"
    Draft202012Validator(SCHEMA).validate(data)
    READ[kind](data, tmp_path / "t.toml")


@pytest.mark.parametrize(
    ("method", "without"), [("ferraris", None), ("aided", "reference"), ("aided", "rig")]
)
def test_the_options_of_a_method_load(method, without, tmp_path):
    """With the "# " taken from their tables, of two of which one stands in the place of the other."""
    text = filled("imu", overrides=[f"imu.method={method}"])
    begin = text.index(f"# [imu.{method}]")
    end = text.index("# [imu.aided]" if method == "ferraris" else "# [simulation]")
    text = text[:begin] + re.sub("(?m)^# ", "", text[begin:end]) + text[end:]
    data = tomllib.loads(text)
    if without:
        del data["imu"][method][without]
    Draft202012Validator(SCHEMA).validate(data)
    assert type(imu_study(data, "t.toml").method).__name__ == f"{method.title()}Settings"


@pytest.mark.parametrize("kind", READ)
def test_what_must_be_filled_in_is_named_in_one_sentence(kind, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(template(kind).replace("# operator", 'date = "?"\n# operator'), encoding="utf-8")
    load = partial(load_study, SYSTEMS[kind])
    with pytest.raises(StudyError) as refused:
        load(path)
    assert str(refused.value).removeprefix(f"{path}: ") == (
        'fill in site.latitude and traceability.date: found "?", expected their values in the file, or as '
        '--set site.latitude="48.1 deg"'
    )
    filled_in = load(path, ["site.latitude=48.1 deg", "traceability.date=today"])
    assert filled_in.site.latitude == pytest.approx(math.radians(48.1))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("site.latitud=48 deg", "site.latitud: unknown key, did you mean latitude?"),
        ("site.latitude=48", "site.latitude: found '48' without a unit"),
        ("site.latitude", "found no key and value"),
    ],
)
def test_a_new_study_refuses_what_it_cannot_state(override, words):
    with pytest.raises(StudyError, match=re.escape(words)):
        template("imu", overrides=[override])


def test_gravity_is_enough_where_nothing_turns_with_the_earth():
    data = tomllib.loads(template("imu", overrides=["site.gravity=9.81 m/s^2"]))
    assert imu_study(data, "t.toml").site.gravity == 9.81
    with pytest.raises(StudyError, match=r"site\.latitude: missing"):
        template("turntable", overrides=["site.gravity=9.81 m/s^2"])


def test_keys_of_the_instrument_can_be_stated():
    stated = [
        "instrument.dwell=30 s",
        "instrument.coefficients.DX_F=4 deg/h",
        "instrument.coefficients.DX_Y=1 deg/h/g",
    ]
    found = turntable_study(tomllib.loads(filled("turntable", overrides=stated)), "t.toml").instrument
    assert found.dwell == 30.0
    assert {"DX_F", "DX_X", "DX_XX", "DX_Y", "k_x"} == set(found.coefficients)


@pytest.mark.parametrize("channels", INSTRUMENTS.values(), ids=INSTRUMENTS)
def test_the_instrument_is_that_of_the_record_with_examples_in_its_unit(channels):
    """Every example loads, alone and with all others; kind and unit are those of the channels."""
    text = filled("turntable", channels=channels)
    table = re.search(r"(?ms)^\[instrument\].*?(?=^(# )?\[design\])", text)[0]
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
    everything = turntable_study(
        tomllib.loads(text.replace(table, re.sub(r"(?m)^# (\w+ = )", r"\1", table))), "t.toml"
    ).instrument
    assert len(everything.coefficients) == 4
    assert all(symbol.split("_")[-1][0] in (name[-1], *"XFx") for symbol in everything.coefficients)
    assert everything.noise is not None


def test_counts_are_told_to_state_the_response_to_earth_rate():
    text = filled("turntable", channels={"y_x": parse_unit("count")})
    assert re.search(r'# k_x = ".* count/\(deg/h\)" +# .*; needed where it is not fitted', text)
    assert 'or "stated", which needs k below' in text
    assert "needed" not in filled("turntable")


def test_the_next_command_of_a_turntable():
    assert "# Next: inercal sensitivity t.toml\n" in filled("turntable", (), "t.toml")
    assert "# Next: inercal calibrate turntable a.csv --study t.toml\n" in filled(
        "turntable", ["a.csv"], "t.toml"
    )


def test_the_header_names_the_next_command():
    assert "# Next: inercal calibrate imu RECORD.csv --study" in filled("imu")
    assert "# Next: inercal calibrate imu 'run 1.csv' b.csv --study" in filled(
        "imu", [Path("run 1.csv"), "b.csv"]
    )
    assert "# Next: inercal calibrate imu a.csv --map my-map.toml --study my.toml\n" in filled(
        "imu", ["a.csv"], "my.toml", "my-map.toml"
    )


@pytest.mark.parametrize("name", ["a\nb = 1", "a\x00b", "a\udcffb", "{records}", "a\u2028b"])
def test_odd_file_names_stay_in_their_comment(name):
    imu_study(tomllib.loads(filled("imu", [name])), "t.toml")
