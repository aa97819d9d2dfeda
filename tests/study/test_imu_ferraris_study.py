"""The table [imu.ferraris]: quantities in SI, sections in time or samples, and what is refused."""

import math

import pytest

import inercal as ic
from inercal.faces.studies.ferraris import FerrarisTable, ferraris_settings
from inercal.foundation._toml import check
from inercal.foundation.errors import StudyError
from inercal.systems.imu.settings import FerrarisSettings
from rows import for_each


def settings(**table):
    return ferraris_settings(check(FerrarisTable, table, "study.toml: imu.ferraris", StudyError))


def test_nothing_given():
    assert settings() == FerrarisSettings(2.0 * math.pi, 0.0, None, {})


def test_quantities_come_in_si():
    told = settings(turn="-720(1.5) deg", alignment="0.5 deg")
    assert told.turn == pytest.approx(-4.0 * math.pi)
    assert told.turn_u == pytest.approx(math.radians(1.5))
    assert told.alignment == pytest.approx(math.radians(0.5))


def test_sections_in_time_and_in_samples():
    told = settings(sections={"x_p": ["5.2 s", "0.5 min"], "z_rot": [540, 1271]})
    assert told.sections == {"x_p": (5.2, 30.0), "z_rot": (540, 1271)}
    assert isinstance(told.sections["z_rot"][0], int)


@for_each(
    ("table", "words"),
    [
        ({"turn": "360"}, "without a unit"),
        ({"turn": "0 deg"}, "expected an angle of 10 deg"),
        ({"alignment": "-1 deg"}, "expected a standard uncertainty up to 20 deg"),
        ({"sections": {"x_q": [1, 5]}}, "did you mean"),
        ({"sections": {"x_p": [5, 5]}}, "the end after the start"),
        ({"sections": {"x_p": ["7 s", "5 s"]}}, "the end after the start"),
        ({"sections": {"x_p": ["7 m", "8 m"]}}, "of length"),
        ({"sections": {"x_p": [1, "8 s"]}}, 'expected ["start", "end"]'),
        ({"sections": {"x_p": 5}}, 'expected ["start", "end"]'),
        ({"sections": {"x_p": [True, 5]}}, 'expected ["start", "end"]'),
    ],
)
def test_what_is_refused(table, words):
    with pytest.raises(StudyError) as error:
        settings(**table)
    assert words in str(error.value)
    assert "imu.ferraris" in str(error.value)


def test_the_schema_shows_the_sections():
    schema = FerrarisTable.model_json_schema()
    assert "x_rot" in schema["$defs"]["SectionsTable"]["properties"]


def test_tables_of_a_method_are_keywords_too():
    """``ic.study("imu", ferraris={...})`` is the study of the same file; so are ``turns`` and the rig of ``aided``."""
    here = {"gravity": "9.81 m/s^2"}
    alone = ic.study("imu", **here, method="ferraris", ferraris={"turn": "-360(2) deg"})
    whole = ic.study("imu", site=here, imu={"method": "ferraris", "ferraris": {"turn": "-360(2) deg"}})
    assert alone.settings == whole.settings
    turns = dict.fromkeys("xyz", "360(1) deg")
    assert ic.study("imu", **here, method="known_turns", turns=turns).settings.method.angles[0] > 6.0
    table = {"rig": {"kind": "two_axis_turntable"}, "mounting": ["+y", "-x", "+z"]}
    assert ic.study("imu", latitude="48 deg", method="aided", aided=table).settings.method is not None
