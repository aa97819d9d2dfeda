"""Whatever the study of a turntable holds: a study, or one `StudyError` of one line."""

import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from new_studies import filled, load_turntable_study

from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.errors import StudyError
from inercal.systems.turntable.settings import TurntableSettings
from rows import for_each

RELAXED = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60
)
# grids are made small: what is checked is the reading
TEMPLATE = re.sub(
    r"(?m)^# (\w+ = )",
    r"\1",
    filled("turntable").replace("36", "6"),
).encode()
HEAD = '[site]\nlatitude = "39.1 deg"\n[rig]\nkind = "two_axis_turntable"\n'
ERRORS = HEAD + "[rig.errors]\n"
INSTRUMENT = HEAD + "[instrument]\n"
COEFFICIENTS = HEAD + "[instrument.coefficients]\n"
CHAIN = HEAD.replace("two_axis_turntable", "chain")
JOINT, E = '{ joint = "phi1", axis = "z" }', '{ error = "e", axis = "x", normal = "1 arcsec" }'
DESIGN = ERRORS + 'default = { uniform = "2 arcmin" }\n[design]\n'


@pytest.fixture
def load(tmp_path):
    def load(content):
        path = tmp_path / "study.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return load_turntable_study(path)

    return load


@for_each(
    ("text", "message"),
    [
        ("", "rig: missing, expected a value"),
        ('[rig]\nkind = "two_axis_turntable"', "site.latitude: missing, expected the latitude of the table"),
        (
            HEAD.replace('latitude = "39.1 deg"', 'gravity = "9.8 m/s^2"'),
            "site.latitude: missing, expected the latitude of the table for earth rate",
        ),
        (
            HEAD.replace("39.1", "120"),
            "site.latitude: found '120 deg', that is 2.0944 rad, expected a latitude",
        ),
        (HEAD.replace("two", "four"), "rig.kind: found 'four_axis_turntable', expected 'two_axis_turntable'"),
        (HEAD + "speed = 1", "rig.speed: unknown key, known keys: kind, chain, errors, base, limits"),
        (HEAD + "[postions]", "postions: unknown key, did you mean positions?"),
        # errors of the table
        (
            ERRORS + 'deps_q = { uniform = "1 arcmin" }',
            "rig.errors.deps_q: unknown key, did you mean deps_y?",
        ),
        (
            ERRORS + 'dphi_y2 = { uniform = "1 arcmin" }',
            "rig.errors.dphi_y2: unknown error of a two_axis_turntable, did you mean",
        ),
        (
            ERRORS + 'deps_x = { normal = "1 arcmin" }\ndeps_x = { normal = "2 arcmin" }',
            "line 7: deps_x is given a second time, expected it once",
        ),
        (ERRORS + 'default = { uniform = "0 arcmin" }', 'an error is left out with NAME = "none"'),
        (
            ERRORS + 'default = { uniform = "-2 arcmin" }',
            "found '-2 arcmin', that is -0.000581776 rad, expect",
        ),
        (ERRORS + 'default = { uniform = "nan arcmin" }', "rig.errors.default.uniform: found 'nan arcmin'"),
        (
            ERRORS + "default = { uniform = nan }",
            "rig.errors.default.uniform: found nan, expected a quantity",
        ),
        (ERRORS + 'default = { uniform = "181 deg" }', "expected a half width above 0 and up to 180 deg"),
        (
            ERRORS + 'default = { normal = "61 deg" }',
            "expected a standard deviation above 0 and up to 60 deg",
        ),
        (ERRORS + 'default = { uniform = "2" }', "rig.errors.default.uniform: found '2' without a unit"),
        (
            ERRORS + 'default = { uniform = "2 arcmin", normal = "1 arcmin" }',
            "rig.errors.default: found uniform and normal, expected one distribution",
        ),
        (
            ERRORS + 'deps_y = { two_point = "1 arcmin", triangular = "1 arcmin" }',
            "rig.errors.deps_y: found triangular and two_point, expected one distribution",
        ),
        (
            ERRORS + 'default = { scope = "rig" }',
            "rig.errors.default: found no distribution, expected uniform",
        ),
        (ERRORS + 'deps_x = { scope = "rig" }', "rig.errors.deps_x: found no distribution, expected uniform"),
        (
            ERRORS + 'default = { uniform = "1 arcmin" }\nd_eta = { scope = "rig" }',
            "rig.errors.d_eta: found no distribution",
        ),
        (
            ERRORS + 'deps_x = { scope = "day" }',
            "rig.errors.deps_x.scope: found 'day', expected 'sample', 'pos",
        ),
        (
            ERRORS + 'deps_x = { unifrm = "1 deg" }',
            "rig.errors.deps_x.unifrm: unknown key, did you mean uniform",
        ),
        (
            ERRORS + 'deps_x = "1 arcmin"',
            "rig.errors.deps_x: found '1 arcmin', expected \"none\" or a table such",
        ),
        (ERRORS + "deps_x = 1", "rig.errors.deps_x: found 1, expected a table"),
        (
            ERRORS + 'd_eta = { uniform = "1 arcmin" }',
            "rig.errors.d_eta.uniform: found '1 arcmin', which is of a",
        ),
        (
            ERRORS + 'deps_x = { uniform = "1 mm" }',
            "rig.errors.deps_x.uniform: found '1 mm', which is of length",
        ),
        # what is measured, and what follows an angle
        (
            ERRORS + 'dbase_x = { normal = "1 arcsec", scope = "angle" }',
            'rig.errors.dbase_x.scope: found "angle" before the first joint, expected another scope',
        ),
        (
            ERRORS + 'dbase_x = { harmonics = [{ order = 1, amplitude = "1 arcsec" }] }',
            "rig.errors.dbase_x: found an error over angle before the first joint, expected a value",
        ),
        (
            ERRORS + 'deps_x = { certificate = "K" , normal = "1 arcsec" }',
            "rig.errors.deps_x: found a certificate of nothing measured, expected value, table or a phase",
        ),
        (
            ERRORS + 'deps_x = { value = "1(1) arcsec", scope = "run" }',
            "rig.errors.deps_x.scope: found with what is measured alone, expected it with a distribution",
        ),
        (ERRORS + 'deps_x = { value = "11 deg" }', "that is 0.191986 rad, expected an angle within 10 deg"),
        (
            ERRORS + 'dphi_y1 = { harmonics = [{ order = 0, amplitude = "1 arcsec" }] }',
            "rig.errors.dphi_y1.harmonics.0.order: found 0, expected greater than or equal to 1",
        ),
        (
            ERRORS
            + 'dphi_y1.harmonics = [{ order = 2, amplitude = "1 arcsec" }, { order = 2, amplitude = "1 arcsec" }]',
            "rig.errors.dphi_y1.harmonics.1.order: found 2 twice, expected each order once",
        ),
        (
            ERRORS + 'dphi_y1 = { table = "gone.csv" }',
            "rig.errors.dphi_y1.table: 'gone.csv': cannot be read (No such file or directory), expected a CSV beside",
        ),
        # a chain of one's own
        (CHAIN + "chain = []", "rig.chain: found the joints none, expected phi1, then phi2, phi3"),
        (
            CHAIN + 'chain = [{ joint = "phi2", axis = "z" }]',
            "rig.chain: found the joints phi2, expected phi1, then phi2, phi3",
        ),
        (CHAIN + 'chain = [{ joint = "phi1" }]', "rig.chain.0.axis: missing, expected a value"),
        (
            CHAIN + 'chain = [{ joint = "phi1", turn = "1 deg", axis = "z" }]',
            "rig.chain.0: found joint and turn, expected one of joint, turn and error",
        ),
        (
            CHAIN + 'chain = [{ joint = "phi1", axis = "z", normal = "1 arcsec" }]',
            "rig.chain.0.normal: found with a joint, expected it with an error only",
        ),
        (
            CHAIN + f'chain = [{JOINT}, {{ error = "e", axis = "z" }}]',
            "rig.chain.1: found no distribution, expected uniform",
        ),
        (
            CHAIN + f'chain = [{JOINT}, {{ error = "1 e", axis = "z", normal = "1 arcsec" }}]',
            "rig.chain.1.error: found '1 e', expected a name of letters, digits and _",
        ),
        (
            CHAIN + f"chain = [{JOINT}, {E}, {E}]",
            "rig.chain: found e twice, expected each name once in a chain",
        ),
        (
            CHAIN + f'chain = [{{ error = "e", axis = "x", normal = "1 arcsec", scope = "angle" }}, {JOINT}]',
            'rig.chain.0.scope: found "angle" before the first joint',
        ),
        (
            CHAIN + f'chain = [{{ turn = "1(1) deg", axis = "x" }}, {JOINT}]',
            "rig.chain.0.turn: found an uncertainty, expected it as an error with a value beside the turn",
        ),
        (
            CHAIN + f'chain = [{JOINT}]\n[rig.errors]\ndefault = {{ normal = "1 arcsec" }}',
            "rig.errors: found with a chain, expected its errors among rig.chain",
        ),
        (
            HEAD + f"chain = [{JOINT}]",
            "rig.chain: found with kind = 'two_axis_turntable', expected it with \"chain\" only",
        ),
        # base and limits
        (HEAD + '[rig.base]\nazimut = "1 deg"', "rig.base.azimut: unknown key, did you mean azimuth?"),
        (
            HEAD + '[rig.limits]\nphi1 = ["90 deg", "-90 deg"]',
            "found '90 deg' to '-90 deg', expected the lower",
        ),
        (HEAD + '[rig.limits]\nphi1 = ["90 deg"]', "rig.limits.phi1"),
        (HEAD + '[rig.limits]\nphi3 = ["0 deg", "9 deg"]', "a two_axis_turntable has phi1, phi2 only"),
        # positions
        (
            HEAD + '[positions]\nplan = "24-postion"',
            "positions.plan: found '24-postion', did you mean 24-posi",
        ),
        (HEAD + '[positions]\nplan = "x"\n', "positions.plan: found 'x', expected 6-position, 8-position"),
        (
            HEAD + '[positions]\nplan = "24-position"\nlist = [["0 deg", "0 deg"]]',
            "positions: found plan and list, expected one of them",
        ),
        (
            HEAD + '[positions]\nlist = [["0 deg", "0 deg"]]\nfile = "p.csv"',
            "positions: found list and file, expected one of them",
        ),
        (HEAD + '[positions]\nfile = "p.csv"', "positions.file: 'p.csv': no such file beside the study"),
        (HEAD + '[positions]\nfile = ""', "positions.file: found ''"),
        (HEAD + '[positions]\nfile = "\\u0000"', "positions.file: '\\x00': no such file beside the study"),
        (
            ERRORS + 'deps_x = { uniform = "2 arcmn" }',
            "rig.errors.deps_x.uniform: found the unit 'arcmn', expected a unit of angle: rad, mrad, urad, deg, arcmin",
        ),
        (HEAD + "[positions]\nlist = []", "positions.list: found []"),
        (HEAD + '[positions]\nlist = [["0 deg"]]', "positions.list.0: found 1 angles, expected phi1, phi2"),
        (HEAD + "[positions]\nlist = [[0, 1]]", "positions.list.0.0: found '0' without a unit"),
        (HEAD + "[positions]\ngrid = { phi1 = 36 }", "positions.grid: found phi1, expected phi1, phi2"),
        (HEAD + "[positions]\ngrid = { phi1 = 0, phi2 = 1 }", "positions.grid.phi1: found 0"),
        (
            HEAD + "[positions]\ngrid = { phi1 = 9, phi2 = 9, phi3 = 9 }",
            "found phi1, phi2, phi3, expected phi1, p",
        ),
        (
            HEAD + "[positions]\ngrid = { phi1 = 9999, phi2 = 9999 }",
            "found 99980001 positions, expected at most",
        ),
        (
            HEAD + '[rig.limits]\nphi1 = ["0 deg", "30 deg"]\n[positions]\nplan = "24-position"',
            "positions.plan 24-position: found position 2 (45 deg, 0 deg) beyond rig.limits",
        ),
        (
            HEAD + '[rig.limits]\nphi1 = ["1 deg", "2 deg"]\n[positions]\ngrid = { phi1 = 4, phi2 = 4 }',
            "positions.grid: found no position within rig.limits",
        ),
        # analysis
        (HEAD + '[analysis]\noutputs = ["ax", "bx"]', "analysis.outputs.1: found 'bx', expected 'ax', 'ay'"),
        (
            HEAD + '[analysis]\noutputs = ["ax", "ax"]',
            "analysis.outputs: found 'ax' twice, expected each once",
        ),
        (HEAD + "[analysis]\noutputs = []", "analysis.outputs: found []"),
        (HEAD + "[analysis]\nsamples = 1", "analysis.samples: found 1, expected greater than or equal to 2"),
        (HEAD + "[analysis]\nseed = -1", "analysis.seed: found -1"),
        (
            HEAD + '[analysis]\nmethod = "exakt"',
            "analysis.method: found 'exakt', expected 'exact', 'sampled' or",
        ),
        # instrument
        (INSTRUMENT + 'kind = "clock"', "instrument.kind: found 'clock', expected 'gyrowheel', 'gyro' or"),
        (INSTRUMENT + 'unit = "m"', 'instrument.unit: found "m" (length), expected a unit of rate'),
        (INSTRUMENT + 'unit = "furlong/h"', "instrument.unit: found"),
        (INSTRUMENT + 'terms = ["DX_Q"]', "instrument.terms.0: unknown term 'DX_Q', did you mean DX_"),
        (INSTRUMENT + 'terms = ["DX_F", "DX_F"]', "instrument.terms: found DX_F twice"),
        (INSTRUMENT + "terms = []", "instrument.terms: found []"),
        (INSTRUMENT + 'noise = "0.01 m"', "instrument.noise: found '0.01 m', which is of length"),
        (INSTRUMENT + 'noise = "0 deg/h"', "instrument.noise: found '0 deg/h', expected a value above zero"),
        (INSTRUMENT + 'unit = "V"\nnoise = "1 deg/sqrt(h)"', "instrument.noise: found '1 deg/sqrt(h)'"),
        (INSTRUMENT + 'dwell = "0 s"', "instrument.dwell: found '0 s', expected a time above zero"),
        (
            INSTRUMENT + 'earth_rate = "known"',
            "instrument.earth_rate: found 'known', expected 'fitted' or 'sta",
        ),
        (COEFFICIENTS + 'K1_x = "1"', "instrument.coefficients.K1_x: unknown term 'K1_x'"),
        (
            COEFFICIENTS + 'DX_F = "50 deg"',
            "instrument.coefficients.DX_F: found '50 deg', expected a quantity su",
        ),
        (
            COEFFICIENTS + 'DX_F = "50 deg/h/g"',
            "found '50 deg/h/g', expected a quantity such as \"1.5 rad/s\"",
        ),
        (COEFFICIENTS + 'DX_XX = "2 deg/h/g"', 'at the gravity of the site) or "1.5 rad/s/g^2"'),
        (COEFFICIENTS + "DX_X = 2", "instrument.coefficients.DX_X: found 2, expected a quantity such as"),
        (
            COEFFICIENTS + 'k_x = "1 deg/h"',
            "instrument.coefficients.k_x: found '1 deg/h', expected a quantity",
        ),
        (COEFFICIENTS + "DX_F = { value = 1 }", "instrument.coefficients.DX_F: found {'value': 1}, expected"),
        # design and rate test
        (DESIGN + "positions = 0", "design.positions: found 0"),
        (DESIGN + 'criterion = "E"', "design.criterion: found 'E', expected 'D', 'A' or 'I'"),
        (DESIGN + 'compare = ["24"]', "design.compare.0: found '24', expected 6-position"),
        (
            DESIGN + 'sensitivity = { factors = ["dtheta_q"], outputs = ["ax"], below = 0.1 }',
            "design.sensitivity.factors: found 'dtheta_q', did you mean dtheta_",
        ),
        (
            DESIGN + 'sensitivity = { factors = ["dtheta_x"], outputs = ["ax"], below = 0 }',
            "design.sensitivity.below: found 0, expected a number above 0, at most 1",
        ),
        (DESIGN + "sensitivity = {}", "design.sensitivity.factors: missing, expected a value"),
        (HEAD + "[rate_test]\nrates = []", "rate_test.rates: found [], expected 1 or more in it"),
        (HEAD + "[rate_test]\norder = 4", "rate_test.order: found 4, expected 1, 2 or 3"),
        (HEAD + '[rate_test]\nat = { phi3 = "1 deg" }', "rate_test.at: found 'phi3', did you mean phi"),
        (HEAD + '[rate_test]\njoint = "phi9"', "rate_test.joint: found 'phi9', did you mean phi"),
        (
            HEAD + '[rate_test]\nfull_scale = "0 deg/s"',
            "found '0 deg/s', that is 0 rad/s, expected a rate above zero",
        ),
        (
            HEAD.replace("two", "three") + '[positions]\nplan = "24-position"',
            "positions.plan: found '24-position', a plan of a two-axis table, expected a grid or a list",
        ),
    ],
)
def test_one_sentence_names_key_found_and_expected(load, text, message):
    with pytest.raises(StudyError, match=re.escape(message)) as caught:
        load(text)
    assert str(caught.value).startswith(caught.value.where)
    assert caught.value.where.endswith("study.toml")
    assert "\n" not in str(caught.value)


def is_study_or_error(make):
    """Run it; anything but a study or a `StudyError` of one short line fails."""
    try:
        study = make()
    except StudyError as error:
        message = str(error)
    else:
        message = ""
        assert isinstance(study, TurntableSettings)
        assert study.site.latitude is not None
        assert (study.chain.std > 0.0).all()
        assert study.plan.angles.shape[1] == len(study.chain.joints)
    assert "\n" not in message
    assert len(message) < 600


@RELAXED
@given(
    start=st.integers(0, len(TEMPLATE)),
    length=st.integers(0, 40),
    junk=st.binary(max_size=8) | st.text().map(str.encode),
)
def test_mutated(load, start, length, junk):
    is_study_or_error(lambda: load(TEMPLATE[:start] + junk + TEMPLATE[start + length :]))


scalars = st.one_of(
    st.booleans(),
    st.integers(-2, 50),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(
        ["2 arcmin", "-1 deg", "10 um", "none", "24-position", "60 s", "1 deg/h/g^2", "ax", "fitted"]
    ),
)
keys = st.text(max_size=8) | st.sampled_from(
    ["default", "deps_x", "d_eta", "uniform", "normal", "scope", "phi1", "phi2", "phi3", "grid", "plan", "list", "file",
     "outputs", "kind", "noise", "unit", "terms", "DX_F", "DX_XX", "coefficients", "joint", "candidates"]
)  # fmt: skip
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=8,
)
TABLES = ["positions", "analysis", "instrument", "design", "rate_test", "errors", "base", "limits"]


@RELAXED
@given(table=st.sampled_from(TABLES), content=st.dictionaries(keys, values, max_size=4) | values)
def test_random_values_of_known_keys(table, content):
    rig = {"kind": "two_axis_turntable"}
    data = {"site": {"latitude": "39.1 deg"}, "rig": rig}
    (rig if table in ("errors", "base", "limits") else data)[table] = content
    is_study_or_error(lambda: turntable_study(data, "study.toml"))


@for_each(
    ("content", "message"),
    [
        ("", "line 1: found '', expected a header such as angle [deg],error [arcsec],u [arcsec]"),
        ("angle [deg],error [arcsec]\n", "line 1: found 'angle [deg],error [arcsec]', expected a header"),
        ("angle [deg],error [mm],u [mm]\n", "line 1: found mm, a unit of length, expected an angle"),
        ("angle [deg],error [arcsec],u [arcsec]\n1,2\n", "line 2: found '1,2', expected three numbers"),
        (
            "angle [deg],error [arcsec],u [arcsec]\n1,2,nan\n",
            "line 2: found '1,2,nan', expected three numbers",
        ),
        ("angle [deg],error [arcsec],u [arcsec]\n1,2,-1\n", "line 2: found u below zero"),
        ("angle [deg],error [deg],u [arcsec]\n1,20,1\n", "line 2: found an error above 10 deg"),
        ("angle [deg],error [arcsec],u [arcsec]\n1,2,1\n", "found 1 rows, expected two or more"),
        ("angle [deg],error [arcsec],u [arcsec]\n1,2,1\n361,2,1\n", "found an angle twice, expected two"),
    ],
)
def test_a_table_over_angle_that_cannot_be_read(load, tmp_path, content, message):
    (tmp_path / "e.csv").write_text(content)
    with pytest.raises(StudyError, match=re.escape(message)) as caught:
        load(ERRORS + 'dphi_y1 = { table = "e.csv" }')
    assert "rig.errors.dphi_y1.table: 'e.csv'" in str(caught.value)
