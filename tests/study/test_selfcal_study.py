"""The study of a self-calibration: what its keys mean, what is taken where they are absent, what is refused."""

import copy
import json
import math
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from new_studies import filled, load_turntable_study
from numpy.testing import assert_allclose
from paper_study import ARCSEC, DEG, MICRO_G, NOISE, PER_HOUR, PPM, PRIOR, TRUTH

from inercal.faces.studies.load import load_imu_study, load_selfcal_study
from inercal.faces.studies.schema import json_schema
from inercal.faces.studies.selfcal import selfcal_study
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.terms import term
from inercal.systems.selfcal.before.path_design import design
from inercal.systems.selfcal.estimators import KINDS
from inercal.systems.selfcal.platform.coefficients import BETA, EXTENDED, NAMES, units
from inercal.systems.selfcal.platform.plan import PATHS, Rest, Turn, path
from inercal.systems.selfcal.platform.states import (
    ALL,
    BIAS_WALK,
    EXTENDED_MODEL,
    PAPER,
    RIG,
    STATES,
    TEMPERATURE,
)
from inercal.systems.selfcal.settings import Gating
from inercal.systems.selfcal.simulate import experiment

# The study of the interface description, to the letter.
CONTRACT = """
# selfcal
[site]
latitude = "40 deg"
[rig]
kind = "three_axis_gimbals"
heading = "0 deg"
[plan]
turns = [["z", "180 deg"], ["x", "90 deg"], ["z", "-180 deg"], ["x", "90 deg"]]    # also ["rest", "60 s"]; a third entry overrides the rate
rate = "1 deg/s"
step = "0.2 s"
[truth]                          # for simulate
kg0 = ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"]    # x, y, z; eta is pz, oy, oz
[noise]
angle_random_walk = "5e-4 deg/sqrt(h)"
accelerometer = "10 ug"          # per sample
encoder = "2 arcsec"
[prior]                          # standard deviations, mean 0
kg0 = "0.3 deg/h"
eta = "300 arcsec"
ds = "300 arcsec"
do = "300 arcsec"
ka0 = "500 ug"
ka1 = "1500 ppm"
[goal]                           # optional: wanted u per coefficient
kg0 = "0.002 deg/h"
[filter]
kind = "error-state"
extended = false
gating = "off"
"""  # noqa: E501
SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)
TEMPLATE = filled("selfcal")


def study(**tables):
    """The study of the contract with these tables in place of its own; None leaves one out."""
    data = tomllib.loads(CONTRACT) | tables
    return selfcal_study({key: table for key, table in data.items() if table is not None}, "s.toml")


def rig(**keys):
    return study(rig={"kind": "three_axis_gimbals"} | keys)


@pytest.fixture
def write(tmp_path):
    def write(text):
        file = tmp_path / "study.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


def test_the_study_of_the_contract(write):
    found = load_selfcal_study(write(CONTRACT))
    assert found.site.latitude == pytest.approx(40.0 * DEG)
    assert found.plan == path("paper")
    assert found.plan.duration == pytest.approx(540.0)
    assert (found.gimbals.axes, found.gimbals.signs) == (("z", "x", "y"), (1, 1, 1))
    assert_allclose(found.truth, [*TRUTH[:3], *np.zeros(21)], rtol=1e-12)
    assert_allclose(found.prior, PRIOR, rtol=1e-12)
    nominal = NOISE["nominal"]
    assert found.noise.angle_random_walk == pytest.approx(nominal.angle_random_walk)
    assert found.noise.accelerometer == pytest.approx(nominal.accelerometer)
    assert found.noise.encoder == pytest.approx(nominal.encoder)
    assert found.goal == pytest.approx(dict.fromkeys(NAMES[:3], 0.002 * PER_HOUR))
    assert (found.filter.kind, found.filter.gating, found.kinds) == ("error-state", None, RIG)
    assert found.disturbances.dropouts == 0.0
    assert json.loads(json.dumps(found.given)) == tomllib.loads(CONTRACT)
    VALIDATOR.validate(tomllib.loads(CONTRACT))


def test_what_is_absent_is_as_in_the_paper():
    found = study(plan=None, truth=None, prior=None, goal=None, filter=None)
    assert (found.plan, found.truth, dict(found.goal)) == (None, None, {})
    assert_allclose(found.prior, PRIOR, rtol=1e-12)
    assert found.filter.kind == KINDS[0]


def test_all_truths_in_their_order():
    texts = {
        "kg0": ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"],
        "eta": ["60 arcsec", "-90 arcsec", "120 arcsec"],
        "ds": ["60 arcsec", "-45 arcsec", "90 arcsec"],
        "do": ["-75 arcsec", "50 arcsec", "-100 arcsec"],
        "ka0": ["100 ug", "-150 ug", "200 ug"],
        "ka1": ["500 ppm", -300e-6, "0.0008"],
        "kg1": ["10 ppm", "20 ppm", "0 ppm"],
        "beta": ["5 arcsec", "0 rad", "1 arcmin"],
    }
    expected = [*TRUTH[:18], 10 * PPM, 20 * PPM, 0.0, 5 * ARCSEC, 0.0, 60 * ARCSEC]
    assert_allclose(study(truth=texts).truth, expected, rtol=1e-12)
    assert_allclose(study(truth={}).truth, np.zeros(24))


def test_one_deviation_for_a_group_or_three():
    found = study(
        prior={"ka0": ["1 ug", "2 ug", "3 ug"], "kg1": "5 ppm"}, goal={"do": ["1 rad", "2 rad", "3 rad"]}
    )
    by_name = dict(zip(EXTENDED, found.prior, strict=True))
    assert [by_name[f"ka0_{i}"] / MICRO_G for i in "xyz"] == pytest.approx([1.0, 2.0, 3.0])
    assert [by_name[f"kg1_{i}"] / PPM for i in "xyz"] == pytest.approx([5.0] * 3)
    assert found.goal == pytest.approx({"do_x": 1.0, "do_y": 2.0, "do_z": 3.0})


def test_the_uncertainty_of_the_base_widens_the_prior_of_the_encoders_zero():
    """b is north, up, east: tilt about north and east, heading about up; squares add."""
    level = rig(heading="10(3) arcmin", tilt=["0 ± 1 arcmin", "0 ± 2 arcmin"])
    assert level.base.heading_u == pytest.approx(3 * 60 * ARCSEC)
    assert_allclose(level.prior[BETA], np.sqrt([1 + 1, 1 + 9, 1 + 4]) * 60 * ARCSEC, rtol=1e-4)
    # at a heading of 90 deg X_b looks east, Z_b south: the tilts change places
    east = rig(heading="90 deg", tilt=["0 ± 1 arcmin", "0 ± 2 arcmin"])
    assert_allclose(east.prior[BETA], np.sqrt([1 + 4, 1, 1 + 1]) * 60 * ARCSEC, rtol=1e-9)
    # east-north-up: up is z
    enu = rig(heading="0.0(1) deg", frame="enu")
    assert_allclose(enu.prior[BETA], [60 * ARCSEC, 60 * ARCSEC, math.hypot(360, 60) * ARCSEC], rtol=1e-9)


def test_the_rig():
    found = rig(
        heading="30 deg",
        tilt=["1 deg", "-2 deg"],
        frame="ned",
        gimbals=["x", "y", "z"],
        signs=[1, -1, 1],
        limits={"x": ["-200 deg", "200 deg"], "y": ["-80 deg", "1 rad"]},
    )
    assert found.base.frame == "ned"
    assert_allclose([found.base.heading, *found.base.tilt], [30 * DEG, DEG, -2 * DEG])
    assert (found.gimbals.axes, found.gimbals.signs) == (("x", "y", "z"), (1, -1, 1))
    assert set(found.limits) == {"th_x", "th_y"}
    assert_allclose(found.limits["th_y"], [-80 * DEG, 1.0])


def test_turns_rests_rates_and_the_start():
    plan = study(
        plan={
            "turns": [["z", "180 deg"], ["rest", "1 min"], ["x", "-90 deg", "2 deg/s"]],
            "rate": "0.5 deg/s",
            "step": "100 ms",
            "start": ["10 deg", "0 deg", "-1 rad"],
        }
    ).plan
    assert plan.moves == (Turn("z", math.pi), Rest(60.0), Turn("x", -math.pi / 2, 2 * DEG))
    assert plan.duration == pytest.approx(360.0 + 60.0 + 45.0)
    assert_allclose(plan.start, [10 * DEG, 0.0, -1.0])
    assert plan.step == 0.1


@pytest.mark.parametrize("name", PATHS)
def test_paths_by_their_name_at_the_rate_of_the_plan(name):
    plan = study(plan={"path": name, "rate": "2 deg/s", "step": "0.1 s"}).plan
    assert plan.moves == path(name).moves
    assert plan.duration == pytest.approx(0.5 * path(name).duration)


def test_set_of_a_path_takes_the_place_of_the_turns(write):
    assert load_selfcal_study(write(CONTRACT), ["plan.path=best"]).plan == path("best")
    found = load_selfcal_study(write(CONTRACT), ['plan.turns=[["z", "90 deg"]]', "filter.kind=map"])
    assert found.plan.moves == (Turn("z", math.pi / 2),)
    assert found.filter.kind == "map"


def test_filter_disturbances_and_design():
    found = study(
        filter={
            "kind": "gimbal-ukf", "extended": True, "gating": "two", "gating_stops": "step", "factor": "svd",
            "integration": "euler",
        },
        disturbances={
            "dropouts": "1 %", "command_delay": "0.2 s", "flicker": "1 ug", "gyro_flicker": "0.001 deg/h",
            "servo_jitter": "1 deg/h", "stamp_jitter": "0.1 ms", "quantisation": "1 arcsec", "lost_rows": "2 %",
            "base_sway": {"amplitude": "2 arcsec", "frequency": "0.3 Hz"},
            "harmonics": [{"axis": "z", "order": 2, "amplitude": "5 arcsec", "phase": "90 deg"},
                          {"axis": "x", "order": 1, "amplitude": "1 arcsec"}],
        },
        design={"turns": 4, "angle": "45 deg", "time": "10 min", "criterion": "mean", "seed": 7},
    )  # fmt: skip
    assert (found.filter.kind, found.filter.factor, found.filter.integration) == (
        "gimbal-ukf",
        "svd",
        "euler",
    )
    assert found.filter.gating == Gating("two", "step")
    assert found.states.names == EXTENDED
    second, first = found.disturbances.harmonics
    assert (second.axis, second.order, first.axis, first.order) == ("z", 2, "x", 1)
    found_sizes = [second.amplitude, second.phase, first.amplitude, first.phase]
    assert_allclose(found_sizes, [5 * ARCSEC, math.pi / 2, ARCSEC, 0.0])
    assert (found.disturbances.dropouts, found.disturbances.command_delay) == (0.01, 0.2)
    other = found.disturbances
    assert_allclose(
        [
            other.flicker,
            other.gyro_flicker,
            other.servo_jitter,
            other.quantisation,
            other.base_sway.amplitude,
        ],
        [MICRO_G, 0.001 * PER_HOUR, PER_HOUR, ARCSEC, 2 * ARCSEC],
    )
    assert (other.stamp_jitter, other.lost_rows) == (pytest.approx(1e-4), pytest.approx(0.02))
    assert (found.search.turns, found.search.time, found.search.criterion, found.search.seed) == (
        4,
        600.0,
        "mean",
        7,
    )
    assert found.search.angle == pytest.approx(math.pi / 4)


REFUSED = {
    "noise.encoder=0 arcsec": "noise.encoder: found '0 arcsec', that is 0 rad, expected a standard deviation",
    "noise.accelerometer=-1 ug": "noise.accelerometer: found '-1 ug'.*above zero",
    "noise.angle_random_walk=0 deg/sqrt(h)": "noise.angle_random_walk: .*above zero",
    "noise.encoder=2": "noise.encoder: found '2' without a unit, expected",
    "prior.kg0=0 deg/h": "prior.kg0: .*a standard deviation above zero",
    'prior.eta=["1 arcsec"]': "prior.eta: .*expected a list of 3, for pz, oy, oz, or one for all",
    "goal.ka1=-1 ppm": "goal.ka1: .*a standard uncertainty above zero",
    'truth.kg0=["1 deg/h", "2 deg/h"]': "truth.kg0: .*expected a list of 3, for x, y, z",
    "truth.kg0=1 deg/h": "truth.kg0: found '1 deg/h', expected a list of 3",
    'truth.eta=["60 deg", "0 deg", "0 deg"]': "truth.eta: found '60 deg'.*within 10 deg",
    'truth.ka1=["500", "0", "0"]': "truth.ka1: found '500'.*within 0.5",
    'rig.gimbals=["x", "x", "y"]': 'rig.gimbals: .*"x", "y" and "z" once each',
    "rig.signs=[1, 1, 0]": "rig.signs: .*three of 1 and -1",
    "rig.signs=[1, 1, true]": "rig.signs: .*three of 1 and -1",
    'rig.tilt=["1 deg"]': "rig.tilt: .*about north",
    'rig.limits.x=["0 deg", "-1 deg"]': "rig.limits.x: .*the lower end first",
    'rig.fixed.z="0 deg"': "plan: found a turn of th_z, expected none of a joint of rig.fixed",
    'rig.fixed.w="0 deg"': "rig.fixed.w: unknown key",
    'rig.limits.th_x=["0 deg", "1 deg"]': "rig.limits.th_x: unknown key",
    "rig.heading=north": "rig.heading: found 'north', expected a quantity",
    "rig.frame=NED": "rig.frame: found 'NED', expected 'nue', 'enu' or 'ned'",
    "site.latitude=": "site.latitude: found ''",
    'plan.turns=[["w", "9 deg"]]': "plan.turns.0: found .*expected a turn such as",
    'plan.turns=[["x", 9]]': "plan.turns.0: ",
    'plan.turns=[["x", "0 deg"]]': "plan.turns.0: .*an angle other than 0",
    'plan.turns=[["rest", "-1 s"]]': "plan.turns.0: .*a time above zero",
    'plan.turns=[["x", "9 deg", "0 deg/s"]]': "plan.turns.0: .*a rate above zero",
    'plan.turns=[["x", "1 deg"]]': "plan: found 5 steps of 0.2 s, expected 10",
    'plan.turns=[["x", "1e9 deg"]]': "plan: found 5e[+]09 steps",
    "plan.turns=[]": "plan.turns: found .*expected 1 or more",
    "plan.path=worst": "plan.path: found 'worst', expected 'paper'",
    "plan.step=0 s": "plan.step: .*a time above zero",
    "plan.rate=-1 deg/s": "plan.rate: .*a rate above zero",
    "filter.kind=ukf": "filter.kind: found 'ukf', expected 'error-state'",
    "filter.gating=on": "filter.gating: found 'on', expected 'off'",
    "filter.knd=map": "filter.knd: unknown key, did you mean kind?",
    "disturbances.dropouts=1.0": "disturbances.dropouts: .*below 1",
    'disturbances.harmonics=[{axis = "z", order = 0, amplitude = "1 deg"}]': "disturbances.harmonics.0.order: ",
    "design.turns=0": "design.turns: ",
    "nois.encoder=1 arcsec": "nois: unknown key, did you mean noise?",
    "noise.gyro_walk=0 deg/h/sqrt(s)": "noise.gyro_walk: found .*a walk above zero",
    'model.harmonics=[{axis = "x", order = 1, amplitude = "5 arcsec"}]': "model.harmonics.0.*found '5 arcsec'",
    "model.sag=3 arcsec": "model.sag: ",
    'disturbances.temperature=["20 degC"]': "disturbances.temperature: ",
    "model.states=all": 'model.states: found .all., expected "paper", "extended", "rig", or a list',
    'model.states=["rig", "rig"]': "model.states: found 'rig', expected one of gamma, ",
    'model.states=["gamma", "gamma"]': "model.states: .*expected each kind once",
}  # fmt: skip


@pytest.mark.parametrize(("override", "words"), REFUSED.items())
def test_one_sentence_for_what_is_wrong(write, override, words):
    with pytest.raises(StudyError, match=words) as error:
        load_selfcal_study(write(CONTRACT), [override])
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(str(error.value.where))


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"noise": None}, "noise: missing, expected a value"),
        ({"noise": {"encoder": "1 arcsec", "accelerometer": "1 ug"}}, "noise.angle_random_walk: missing"),
        ({"rig": None}, "rig: missing"),
        (
            {"site": {"gravity": "9.8 m/s^2"}},
            "site.latitude: missing, expected the latitude of the rig for earth rate",
        ),
        ({"plan": {}}, "plan: found neither turns nor path"),
        ({"plan": {"path": "best", "turns": [["x", "90 deg"]]}}, "plan: found both turns and path"),
        ({"plan": {"turns": "best"}}, "plan.turns: found 'best', expected a list"),
        (
            {"model": {"states": ["rig", "bias_walk"]}, "filter": {"kind": "map"}},
            "model.states: found bias_walk for map",
        ),
        (
            {"model": {"states": "rig"}, "filter": {"kind": "svd-qukf"}},
            "model.states: found gamma, .* for svd-qukf, which has none",
        ),
        ({"filter": {"kind": "mukf"}}, "filter.kind: found 'mukf', .* expected in its place error-state"),
        ({"filter": {"kind": "lm"}}, "filter.kind: found 'lm', .* expected in its place map"),
        (
            {"filter": {"kind": "linear"}},
            "filter.kind: found 'linear', .* expected in its place error-state",
        ),
        (
            {"model": {"states": "rig"}, "filter": {"extended": True}},
            "model.states: found it beside filter.extended",
        ),
        (
            {"model": {"states": ["gamma"], "gamma": "5 arcsec"}},
            "model.gamma: found '5 arcsec' for a state that is estimated, expected it with an uncertainty",
        ),
    ],
)
def test_what_is_missing_or_too_much(tables, words):
    with pytest.raises(StudyError, match=words):
        study(**tables)


def test_studies_of_other_commands_are_told_apart(write):
    for load in (load_imu_study, load_turntable_study):
        with pytest.raises(StudyError, match="a study for `inercal selfcal`"):
            load(write(CONTRACT))
    with pytest.raises(
        StudyError, match="found a study for `inercal calibrate imu`, expected one for `inercal selfcal`"
    ):
        load_selfcal_study(write('[site]\nlatitude = "1 deg"\n[imu]\n'))


def test_the_template_loads_as_written_and_is_the_paper():
    data = tomllib.loads(TEMPLATE)
    found = selfcal_study(data, "t.toml")
    VALIDATOR.validate(data)
    assert found.plan == path("paper")
    assert_allclose(found.truth, TRUTH, rtol=1e-12)
    assert_allclose(found.prior, PRIOR, rtol=1e-12)
    assert found.site.latitude_u == pytest.approx(26 * DEG)


def test_the_next_command_of_the_template():
    assert "# Next: inercal simulate selfcal s.toml --out simulated.csv\n" in filled("selfcal", (), "s.toml")
    assert "# Next: inercal selfcal a.csv --study s.toml\n" in filled("selfcal", ["a.csv"], "s.toml")


SCALARS = st.one_of(st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.just("1 deg"))
JUNK = st.recursive(
    SCALARS, lambda x: st.lists(x, max_size=4) | st.dictionaries(st.text(max_size=4), x, max_size=2)
)
PLACES = [(table, key) for table, keys in tomllib.loads(CONTRACT).items() for key in keys]


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None, max_examples=150)
@given(place=st.sampled_from(PLACES), value=JUNK)
def test_whatever_a_key_holds_it_is_a_study_or_one_sentence(place, value):
    """And what the reader takes, the schema takes too."""
    data = copy.deepcopy(tomllib.loads(CONTRACT))
    data[place[0]][place[1]] = value
    try:
        selfcal_study(data, "s.toml")
    except StudyError as error:
        said = str(error)
    else:
        said = ""
        assert VALIDATOR.is_valid(data)
    assert "\n" not in said


def test_states_of_the_rig():
    """A word or a list; what map leaves out; the prior of a walk is how far biases are from their means."""
    noise = tomllib.loads(CONTRACT)["noise"]
    asked = study(model={"states": ["rig", "k2"]}, noise=noise | {"accelerometer_walk": "1 ug/sqrt(s)"})
    assert asked.kinds == (*RIG, "k2")
    sigma = dict(zip(ALL, asked.priors, strict=True))["ka0_walk_y"]
    assert sigma == pytest.approx(1e-6 * 9.80665 * math.sqrt(30.0))
    waves = [{"axis": "z", "order": 8, "amplitude": "0(2) arcsec"}]
    asked = study(model={"states": ["paper", "harmonics"], "harmonics": waves})
    assert asked.states.names == (*NAMES, "harmonic_1_sin", "harmonic_1_cos")
    assert asked.states.harmonics == ((2, 8),)
    assert asked.priors[asked.states.index][-1] == pytest.approx(2.0 * ARCSEC)
    asked = study(
        model={
            "states": ["paper", "temperature", "sag"],
            "sag": "0(3) arcsec/g",
            "g_sensitivity": "0(0.1) deg/h/g",
        }
    )
    assert asked.states.names[18:] == (
        *STATES["sag"].parameters,
        *(n for k in TEMPERATURE for n in STATES[k].parameters),
    )
    known = dict(zip(ALL, asked.priors, strict=True))
    assert known["sag_y"] == pytest.approx(3.0 * ARCSEC / 9.80665)
    assert known["G_zx"] == pytest.approx(math.radians(0.1) / 3600 / 9.80665)
    assert known["ka1_x_T1"] == pytest.approx(20e-6)
    assert study(model={"states": ["rig", "bias_walk"]}).kinds == (*RIG, *BIAS_WALK)


@pytest.mark.parametrize("kind", KINDS)
def test_states_are_those_of_the_rig_where_the_estimator_has_them(kind):
    """And the paper's where it does not."""
    kinds = RIG if kind in ("error-state", "map") else PAPER
    assert study(filter={"kind": kind}).kinds == kinds
    assert study(filter={"kind": kind, "extended": True}).kinds == EXTENDED_MODEL
    assert study(filter={"kind": kind}, model={"states": "paper"}).kinds == PAPER


def test_the_table_of_terms_knows_every_coefficient_with_its_unit():
    assert tuple(term(name).unit_for("rad/s") for name in ALL) == units(ALL)


def test_a_plan_beyond_the_limits_can_be_searched_from_but_not_simulated():
    limits = {"z": ["-10 deg", "10 deg"]}
    asked = rig(limits=limits)
    with pytest.raises(
        StudyError, match=r"plan: found turns that take th_z beyond rig\.limits, .*-10 deg to 10"
    ):
        experiment(replace(asked, truth=np.zeros(24)))
    near = replace(asked, search=replace(asked.search, turns=2, angle=np.pi / 2))
    table = design(near).table()
    assert re.search(r"^study .*; beyond the limits of th_z$", table, re.MULTILINE)
    assert not re.search(r"^found .*beyond", table, re.MULTILINE)
