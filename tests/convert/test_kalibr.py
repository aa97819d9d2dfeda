"""Kalibr's scale-misalignment model: its equation on its file, its frame, and the YAML that carries it."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from instruments_drawn import assert_same_corrections, instrument, seeds, there_and_back

from inercal.faces.convert import kalibr
from inercal.faces.convert.convention import in_si_outputs
from inercal.faces.convert.correct import ImuModel
from inercal.faces.convert.other_tools import from_tool, to_tool
from inercal.foundation.errors import InputError
from inercal.foundation.instruments.triad import TriadModel
from rows import for_each

RuamelYaml = pytest.importorskip("ruamel.yaml").YAML


@pytest.mark.parametrize("upper", [True, False])
@given(seed=seeds)
@settings(deadline=None, max_examples=40)
def test_there_and_back(upper, seed):
    model = instrument(seed, upper)
    assert_same_corrections(model, there_and_back(model, "kalibr"), seed)


def loaded(model):
    """Our file as a whole YAML reader loads it."""
    model = in_si_outputs(model)
    text = kalibr.render(kalibr.terms(model), model.units)[""]
    return model, RuamelYaml(typ="safe").load(text)["imu0"], text


@given(seed=seeds)
@settings(deadline=None, max_examples=20)
def test_its_own_equation_on_its_own_file_gives_the_outputs(seed):
    """As Kalibr's error terms predict measurements from motion in the frame b."""
    model, imu, _ = loaded(instrument(seed))
    rng = np.random.default_rng(seed)
    f_b, w_b = rng.uniform(-20, 20, (9, 3)), rng.uniform(-5, 5, (9, 3))
    C_i_b = np.array(imu["T_i_b"])[:3, :3]
    gyro = {key: np.array(value) for key, value in imu["gyroscopes"].items()}
    C_gyro_b = gyro["C_gyro_i"] @ C_i_b
    acc = f_b @ (np.array(imu["accelerometers"]["M"]) @ C_i_b).T + imu["accelerometers"]["b"]
    rate = w_b @ (gyro["M"] @ C_gyro_b).T + f_b @ (gyro["A"] @ C_gyro_b).T + gyro["b"]
    for found, true in zip(model.indicate(f_b, w_b), (acc, rate), strict=True):
        np.testing.assert_allclose(found, true, rtol=1e-11, atol=1e-11 * np.abs(true).max())


def test_its_matrices_are_of_the_kind_it_estimates():
    _, imu, text = loaded(instrument(7))
    for M in (imu["accelerometers"]["M"], imu["gyroscopes"]["M"]):
        assert not np.triu(M, 1).any()
    for C in (np.array(imu["T_i_b"])[:3, :3], np.array(imu["gyroscopes"]["C_gyro_i"])):
        np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(C) == pytest.approx(1.0)
        assert np.trace(C) > 2.5  # small misalignments are small turns, also with reversed axes
    assert kalibr.loaded(text, "x")["imu0"]["model"] == imu["model"] == "scale-misalignment"


def test_in_its_frame_the_input_axis_of_accelerometer_x_is_x_and_in_ours_that_of_z_is_z():
    model = instrument(8)
    _, imu, _ = loaded(model)
    axes_b = (
        model.accelerometer.misalignment / np.linalg.norm(model.accelerometer.misalignment, axis=1)[:, None]
    )
    axes_i = axes_b @ np.array(imu["T_i_b"])[:3, :3].T
    np.testing.assert_allclose(axes_i[0], [1, 0, 0], atol=1e-15)
    assert axes_i[1, 2] == pytest.approx(0, abs=1e-15)
    np.testing.assert_allclose(axes_b[2], [0, 0, 1], atol=1e-15)


# As PyYAML dumps what Kalibr holds, with its noise and its pose.
ITS_OWN = """imu0:
  T_i_b:
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  accelerometer_noise_density: 0.006
  accelerometer_random_walk: 0.0002
  accelerometers:
    M:
    - [1.002, 0.0, 0.0]
    - [-0.0005, 0.9966, 0.0]
    - [0.0008, 0.0012, 1.0043]
  gyroscope_noise_density: 0.0004
  gyroscope_random_walk: 4.0e-06
  gyroscopes:
    A:
    - [0.0001, -2.0e-05, 3.0e-05]
    - [-5.0e-05, 6.0e-05, 7.0e-05]
    - [8.0e-05, 9.0e-05, -1.0e-04]
    C_gyro_i:
    - [1.0, 0.0, 0.0]
    - [0.0, 0.8, -0.6]
    - [0.0, 0.6, 0.8]
    M:
    - [1.01, 0.0, 0.0]
    - [0.001, 0.99, 0.0]
    - [0.002, 0.003, 1.02]
  model: scale-misalignment
  rostopic: /imu0
  time_offset: 0.0
  update_rate: 200.0
"""


def test_a_result_of_its_own_is_read_and_what_it_lacks_is_said(tmp_path):
    (tmp_path / "its-imu.yaml").write_text(ITS_OWN)
    estimate = from_tool([tmp_path / "its-imu.yaml"], "kalibr")
    assert estimate["K1_x"].value == 1.002
    assert estimate["M_yx"].value == pytest.approx(-0.0005 / 0.9966)
    assert estimate["M_xy"].value == 0.0
    assert estimate["S_y"].value == pytest.approx(0.99 * 0.8)
    assert estimate["G_xx"].value == pytest.approx(1e-4)
    assert estimate.result["unit"] == {"acc": "m/s^2", "gyro": "rad/s"}
    words = [finding.message for finding in estimate.findings if finding.code == "not_stated"]
    assert any("no uncertainty" in text for text in words)
    assert any("no biases" in text for text in words)


def test_frame_and_biases_are_said_on_the_way_there():
    from instruments_drawn import estimate_of

    made = estimate_of(instrument(9), np.random.default_rng(9))
    codes = [finding.code for finding in to_tool(made, "kalibr").estimate.findings]
    assert codes == ["other_frame", "not_held"]


def test_mirrored_axes_and_accelerometers_alone_have_no_place():
    model = instrument(1)
    mirrored = TriadModel(np.ones(3), np.array([[1.0, 2, 0], [2, 1, 0], [0, 0, 1]]), np.zeros(3))
    with pytest.raises(InputError, match="mirrored"):
        kalibr.terms(ImuModel(mirrored, model.gyro, model.g_sensitivity, model.units))
    with pytest.raises(InputError, match="accelerometers alone"):
        kalibr.terms(ImuModel(model.accelerometer, None, np.zeros((3, 3)), {"acc": "count"}))


@for_each(
    ("old", "new", "words"),
    [
        ("imu0:", "cam0:", "found 0 keys imu0"),
        ("    M:\n    - [1.01", "    N:\n    - [1.01", "found no M among the gyroscopes"),
        ("accelerometers:", "acc:", "found no accelerometers in the model 'scale-misalignment'"),
        ("[0.0, 0.8, -0.6]", "[0.0, 0.8, -0.7]", "C_gyro_i that is no rotation"),
        ("[1.002, 0.0, 0.0]", "[1.002, 0.0]", "accelerometers M is not of 3 x 3 numbers"),
        ("[1.002, 0.0, 0.0]", "[1.002, 0.0, x]", "accelerometers M is not of 3 x 3 numbers"),
        ("[1.002, 0.0, 0.0]", "[0.0, 0.0, 0.0]", "not independent"),
        ("    M:\n    - [1.002", "    ry_i: [0.0, 0.003, 0.0]\n    M:\n    - [1.002", "3 mm apart"),
        ("[1.002, 0.0, 0.0]", "{1.002, 0.0, 0.0", "line 12: .*expected keys and numbers"),
        ("imu0:", "7:", "found 0 keys imu0"),
        ("[1.002, 0.0, 0.0]", "[1" + "0" * 400 + ", 0, 0]", "accelerometers M is not of 3 x 3 numbers"),
    ],
)
def test_what_is_no_result_of_kalibr_is_said(tmp_path, old, new, words):
    assert old in ITS_OWN
    path = tmp_path / "bad.yaml"
    path.write_text(ITS_OWN.replace(old, new, 1))
    with pytest.raises(InputError, match=rf"bad\.yaml.*{words}"):
        from_tool([path], "kalibr")


# The reader of YAML.


@pytest.mark.parametrize("flow", [None, False, True])
def test_a_file_of_any_style_gives_the_same(tmp_path, flow):
    yaml, stream = RuamelYaml(typ="safe", pure=True), io.StringIO()
    yaml.default_flow_style = flow
    yaml.dump(RuamelYaml(typ="safe").load(ITS_OWN), stream)
    texts = [kalibr.parse([("x", each)])[0] for each in (ITS_OWN, stream.getvalue())]
    for term, array in texts[0].items():
        np.testing.assert_array_equal(array, texts[1][term])


@pytest.mark.parametrize(
    "text",
    [
        "a: 1\nb:\n  - 1\n  - [2, [3, 4.5e-3]]\n# words\nc: word # more\nd: 'quoted'\n",
        "---\n- a: 1\n  b: [-1, .5]\n- - 1\n  - 2\n-   c: x\n",
        'a:\n- 1\n- 2\n"b": []\nc:\n',
    ],
)
def test_yaml_by_hand_is_read_as_a_whole_reader_reads_it(text):
    assert kalibr.loaded(text, "x") == RuamelYaml(typ="safe").load(text)


@for_each(
    "text",
    ["", "# only words\n", "a: &x [1]\nb: *x\n", "a: [1, 2\n", "a: [1]]\n", "a: 1\n  b: 2\n",
     "a: !!python/name:os.system\n", "a: \0", "[" * 99, "- " * 200 + "1", "a: " + "9" * 5000, "a: 1\n---\nb: 2\n"],
)  # fmt: skip
def test_other_yaml_is_an_error_with_its_place(text):
    with pytest.raises(InputError, match=r"^f\.yaml.*expected keys and numbers"):
        kalibr.loaded(text, "f.yaml")


def test_the_head_of_opencv_is_passed_over():
    """OpenCV writes ``%YAML:1.0``, which is no directive of YAML; lines are counted with it."""
    assert kalibr.loaded("%YAML:1.0\n---\na: 1\n", "x") == {"a": 1}
    with pytest.raises(InputError, match="x, line 3"):
        kalibr.loaded("%YAML:1.0\n---\na: ]\n", "x")


def test_a_bomb_is_refused_before_it_grows():
    """Nine lines by which each list holds the one before nine times: a billion texts."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 9)]
    with pytest.raises(InputError, match="line 2: found an alias"):
        kalibr.loaded("\n".join(lines), "f.yaml")


def test_long_files_are_refused():
    with pytest.raises(InputError, match="expected at most 1048576"):
        kalibr.loaded("a: 1\n" * 300_000, "x")
