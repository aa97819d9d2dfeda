"""A study with some keys spoiled: settings without NaN, or one sentence, whatever the kind of study."""

import copy
import dataclasses
import math
import re
import tomllib
from collections.abc import Mapping
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from new_studies import filled

from inercal.faces.studies.aoa import aoa_study
from inercal.faces.studies.imu import imu_study
from inercal.faces.studies.load import load_aoa_study, load_selfcal_study
from inercal.faces.studies.selfcal import selfcal_study
from inercal.faces.studies.strapdown import strapdown_study
from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.errors import StudyError

# the seed of the examples is fixed: that of each test's own source
FIXED = settings(derandomize=True, deadline=None, suppress_health_check=list(HealthCheck), database=None)
KINDS = {
    "imu": (partial(filled, "imu"), imu_study),
    "strapdown": (partial(filled, "strapdown"), strapdown_study),
    # the grid is made small: what is checked is the reading
    "turntable": (lambda: filled("turntable").replace("36", "6"), turntable_study),
    "selfcal": (partial(filled, "selfcal"), selfcal_study),
    "aoa": (partial(filled, "aoa"), aoa_study),
}
READ = {"selfcal": load_selfcal_study, "aoa": load_aoa_study}
TEXTS = {kind: template().encode() for kind, (template, _) in KINDS.items()}


def keys_of(kind: str) -> list[tuple[tuple[str, ...], object]]:
    """Every key of a template, those that are comments too: where it is, and the value shown there."""
    found, table = [], ()
    for line in TEXTS[kind].decode().splitlines():
        if head := re.match(r"(?:# )?\[([\w.]+)\]", line):
            table = tuple(head[1].split("."))
        elif key := re.match(r"(?:# )?(\w+) = (?=\S)", line):
            try:
                value = tomllib.loads(line.removeprefix("# "))[key[1]]
            except tomllib.TOMLDecodeError:  # the first line of several
                value = tomllib.loads(TEXTS[kind].decode())
                for part in (*table, key[1]):
                    value = value[part]
            found.append(((*table, key[1]), value))
    return found


NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?(?:\(\d+\))?")
numbers = st.sampled_from(
    ["0", "-1", "1e-300", "5e-324", "1e300", "1e400", "nan", "inf", "-inf", "1e9", "1e-9", "0(0)", "1(9)e300",
     "7" * 400]
)  # fmt: skip
units = st.sampled_from(
    ["deg", "m", "s", "Hz", "g", "ppm", "", "V", "count", "furlong", "µm", "arcsec", "1/0"]
)
scalars = st.one_of(
    st.booleans(), st.integers(-3, 10**25), st.floats(), st.text(max_size=8), st.dates(),
    st.builds("{} {}".format, numbers, units),
)  # fmt: skip


def spoiled(value: object) -> st.SearchStrategy[object]:
    """A value with a number or a unit of it changed, wrapped, or another one altogether."""
    ways = [scalars, st.just([]), st.just({}), st.just([value]), st.just({"x": value}), st.just(value)]
    match value:
        case str():
            ways.append(st.builds(lambda new: NUMBER.sub(new, value, count=1), numbers))
            ways.append(st.builds(lambda unit: f"{value.split(' ')[0]} {unit}".strip(), units))
        case bool():
            ways.append(st.just(not value))
        case int() | float():
            ways.append(st.sampled_from([0, -1, value * 10**12, -value, 1e300, math.nan, math.inf]))
        case list() if value:
            ways += [st.just(value[:-1]), st.just(value * 40)]
            ways.append(st.builds(lambda new: [new, *value[1:]], spoiled(value[0])))
        case dict():
            ways += [
                st.builds(lambda new, name=name: {**value, name: new}, spoiled(value[name])) for name in value
            ]
    return st.one_of(ways)


@st.composite
def studies(draw, kind: str) -> tuple[dict, tuple[str, ...]]:
    """The study of a template in which up to three keys are spoiled or left out."""
    data = copy.deepcopy(tomllib.loads(TEXTS[kind].decode()))
    for _ in range(draw(st.integers(1, 3))):
        path, value = draw(st.sampled_from(keys_of(kind)))
        table = data
        for part in path[:-1]:
            table = table.setdefault(part, {})
        if draw(st.integers(0, 9)) == 0:
            table.pop(path[-1], None)
        else:
            table[path[-1]] = draw(spoiled(value))
    return data


def without_nan(value: object, where: str) -> None:
    """Fail where settings hold NaN."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name != "given":  # as the user wrote it
                without_nan(getattr(value, field.name), f"{where}.{field.name}")
    elif isinstance(value, Mapping):
        for name, part in value.items():
            without_nan(part, f"{where}.{name}")
    elif isinstance(value, tuple | list):
        for number, part in enumerate(value):
            without_nan(part, f"{where}.{number}")
    elif isinstance(value, float):
        assert not math.isnan(value), where
    elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
        assert not np.isnan(value).any(), where


def is_study_or_error(make) -> None:
    """Run it; anything but settings without NaN, or a `StudyError` of one line that names the file, fails."""
    try:
        settings, said = make(), "study.toml"
    except StudyError as error:
        settings, said = None, str(error)
    without_nan(settings, "settings")
    assert "study.toml" in said
    assert "\n" not in said
    assert len(said) < 700


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_spoiled_keys(kind):
    @FIXED
    @given(data=studies(kind))
    def check(data):
        is_study_or_error(lambda: KINDS[kind][1](data, "study.toml"))

    check()


@pytest.mark.parametrize("kind", READ)
def test_spoiled_bytes(kind, tmp_path):
    text, path = TEXTS[kind], tmp_path / "study.toml"

    @FIXED
    @given(
        start=st.integers(0, len(text)),
        length=st.integers(0, 40),
        junk=st.binary(max_size=8)
        | st.text(max_size=8).map(str.encode)
        | st.sampled_from([b"\0", b"\r\n", b"\xef\xbb\xbf"]),
        end=st.none() | st.integers(0, len(text)),
    )
    def check(start, length, junk, end):
        path.write_bytes((text[:start] + junk + text[start + length :])[:end])
        is_study_or_error(lambda: READ[kind](path))

    check()


def test_the_keys_of_the_templates_are_found():
    """And a spoiled study is now and then a sound one, lest nothing be tested but the first refusal."""
    for kind, (_, make) in KINDS.items():
        keys = keys_of(kind)
        assert len(keys) > 5, kind
        sound = 0
        for path, value in keys:
            data = tomllib.loads(TEXTS[kind].decode())
            table = data
            for part in path[:-1]:
                table = table.setdefault(part, {})
            table[path[-1]] = value
            try:
                make(data, "study.toml")
                sound += 1
            except StudyError:
                pass
        part = 4 if kind == "imu" else 2  # many keys of an IMU go with one method alone
        assert sound > len(keys) / part, kind
