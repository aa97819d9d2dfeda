"""The error-state filter against the batch: two estimators of one model, which must agree."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grades import GRADES, drawn

import inercal as ic
from inercal.cli import run
from inercal.examples import FOLDER
from inercal.systems.strapdown.fit.batch import fit
from inercal.systems.strapdown.fit.error_state import filtered, measured, predicted
from inercal.systems.strapdown.fit.rests import found_rests, nodes_of
from inercal.systems.strapdown.reading import evened
from inercal.systems.strapdown.simulate import simulated


def both(grade, seed, rate=50.0):
    """Batch and filter of a simulated run."""
    settings = replace(GRADES[grade], plan=replace(GRADES[grade].plan, sample_rate=rate))
    rng = np.random.default_rng([seed, 5])
    samples = simulated(settings, drawn(settings, rng), rng)
    nodes = nodes_of(samples, found_rests(samples, settings.rests), settings.rests.node)
    return fit(samples, nodes, settings), filtered(samples, nodes, settings)


def agree(grade, seed):
    batch, of_filter = both(grade, seed)
    assert batch.converged
    assert of_filter.converged
    u = np.sqrt(np.diag(batch.covariance))
    assert np.abs((of_filter.c - batch.c)[batch.free] / u).max() < 0.01
    assert np.sqrt(np.diag(of_filter.covariance)) == pytest.approx(u, rel=0.01)
    after = np.sqrt(np.einsum("kii->ki", of_filter.history))
    assert np.all(np.diff(after, axis=0) <= 1e-9 * after[0])
    assert 0.8 < of_filter.nis[1:].mean() < 1.2


@pytest.mark.parametrize("grade", ["nav", "tactical"])
def test_the_filter_is_the_batch(grade):
    """To 0.01 u; of tactical grade the heading at the start is not known, 90 deg off in this run."""
    agree(grade, 2)


@pytest.mark.campaign
@pytest.mark.parametrize("grade", ["nav", "tactical"])
def test_the_filter_is_the_batch_in_twenty_runs(grade):
    for seed in range(100, 120):
        agree(grade, seed)


@pytest.mark.kernels
def test_one_step_is_that_of_matrices():
    """Prediction and update of the kernels against the equations of Kalman as matrices."""
    rng = np.random.default_rng(3)
    m, p = 6, 4
    n = m + 6 + p
    root = rng.standard_normal((n, n))
    P, s = root @ root.T, rng.standard_normal(n)
    F, G, Q = rng.standard_normal((m, m)), rng.standard_normal((6, p)), np.eye(m)
    whole = np.eye(n)
    whole[:m, :m], whole[:m, -p:] = F, G
    noise = np.zeros((n, n))
    noise[:m, :m] = Q
    s1, P1 = s.copy(), P.copy()
    predicted(s1, P1, F, G, Q, np.empty((m, n)))
    np.testing.assert_allclose(s1, whole @ s, rtol=1e-12)
    np.testing.assert_allclose(P1, whole @ P @ whole.T + noise, rtol=1e-9, atol=1e-9)
    for i, j in ((4, -1), (1, 7)):
        h = np.zeros(n)
        h[i] += 1.0
        if j >= 0:
            h[j] -= 1.0
        S = h @ P1 @ h + 0.3
        K = P1 @ h / S
        off = 0.7 - h @ s1
        expected = s1 + K * off, P1 - np.outer(K, h @ P1)
        nis = measured(s1, P1, i, j, 0.7, 0.3, np.empty(n))
        assert nis == pytest.approx(off**2 / S)
        np.testing.assert_allclose(s1, expected[0], rtol=1e-9)
        np.testing.assert_allclose(P1, expected[1], rtol=1e-9, atol=1e-9)


def test_the_command_gives_both_and_the_history(tmp_path, capsys):
    out = tmp_path / "cal.json"
    command = ["calibrate", "strapdown", str(FOLDER / "strapdown.bin.gz"),
               "--map", str(FOLDER / "strapdown-map.toml"),
               "--study", str(FOLDER / "strapdown.toml"), "--out", str(out), "--quiet"]  # fmt: skip
    assert run([*command, "--filter", "error-state"]) == 0
    found = ic.load(out)
    result = json.loads(out.read_text())["result"]
    assert result["estimator"] == "error-state"
    assert len(result["history"]) == 19
    for name in found.names:
        one, two = result["compare"]["batch"][name], result["compare"]["error-state"][name]
        assert two["value"] == found.estimate[name].value
        assert abs(one["value"] - two["value"]) < 0.01 * one["u"], name
        # the coefficient is better known after each rest
        u = [each["u"][name] for each in result["history"]]
        assert np.all(np.diff(u) <= 1e-9 * u[0])


def test_the_filter_is_near_the_batch_where_biases_walk():
    """MEMS: to a tenth of u in the four runs that were tried."""
    batch, of_filter = both("mems", 1)
    assert batch.converged
    assert of_filter.converged
    u = np.sqrt(np.diag(batch.covariance))
    assert np.abs((of_filter.c - batch.c)[batch.free] / u).max() < 0.2
    assert np.sqrt(np.diag(of_filter.covariance)) == pytest.approx(u, rel=0.02)


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """A study of navigation grade and a record of nine turns as lines of text."""
    path = tmp_path_factory.mktemp("live")
    settings = ["site.latitude=34 deg", "site.gravity=9.7965(1) m/s^2", "noise.angle_random_walk=5e-4 deg/sqrt(h)",
                "rests.velocity=0.1 mm/s", "noise.velocity_random_walk=5 ug/sqrt(Hz)", "prior.gyro_bias=1 deg/h",
                "plan.dwell=5 s", "noise.gyro_walk=0 deg/h/sqrt(s)", "noise.accelerometer_walk=0 ug/sqrt(s)",
                "plan.first_dwell=20 s", "plan.sample_rate=50 Hz", "truth.r_xx=3 cm",
                "truth.D_F_y=0.4 deg/h"]  # fmt: skip
    keys = [each for text in settings[:-2] for each in ("--set", text)]
    truth = [each for text in settings[-2:] for each in ("--set", text)]
    study, record = str(path / "unit.toml"), str(path / "run.csv")
    assert run(["new", "strapdown", "--out", study, "--quiet", *keys]) == 0
    assert run(["simulate", "strapdown", study, "--seed", "2", *truth, "--out", record, "--quiet"]) == 0
    return study, record


def test_a_stream_says_after_each_rest_what_a_file_says(live, capsys):
    study, record = live
    capsys.readouterr()
    assert run(["calibrate", "strapdown", record, "--study", study, "--stream", "--quiet"]) == 0
    titles, *lines = (line.split(",") for line in capsys.readouterr().out.splitlines())
    assert titles[:2] == ["t [s]", "rests [1]"]
    assert [float(line[1]) for line in lines] == [2.0, 3.0, 4.0, 5.0, 6.0]
    names = [title.partition(" ")[0] for title in titles]
    columns = np.array(lines, dtype=float)
    for k in range(2, len(names)):
        if names[k].startswith("u_"):
            # but for what the point of linearisation does
            assert np.all(np.diff(columns[:, k]) <= 0.01 * columns[0, k]), names[k]
    for end in (5, 6):
        line = columns[end - 2]
        file = ic.calibrate(
            ic.read(record, end=f"{line[0] + 0.7} s"), ic.study(study, strapdown={"filter": "error-state"})
        )
        assert len(file.estimate.result["rests"]) == end
        for name in file.names:
            u = file.estimate.result["bounds"][name]
            assert abs(line[names.index(name)] - file.estimate[name].value) < 0.05 * u, name
            assert line[names.index(f"u_{name}")] == pytest.approx(u, rel=0.02), name


@pytest.mark.kernels
def test_what_a_stream_does_not_take_is_said(live, tmp_path, capsys):
    study, record = live
    assert run(["calibrate", "strapdown", record, "--study", study, "--stream", "--filter", "batch"]) == 2
    assert "--filter: found batch with a stream, expected error-state" in capsys.readouterr().err
    lines = Path(record).read_bytes().splitlines(keepends=True)
    (tmp_path / "gap.csv").write_bytes(b"".join(lines[:300] + lines[320:]))
    assert (
        run(["calibrate", "strapdown", str(tmp_path / "gap.csv"), "--study", study, "--stream", "--quiet"])
        == 2
    )
    assert "a step of 0.42 s after row 299 where 0.02 s is usual" in capsys.readouterr().err
    assert run(["calibrate", "strapdown", "--study", study]) == 2


#: a leap ahead, one out of order, one between its neighbours, the first ones and the last
WRONG = [(1500, 97.0), (1500, 2.0), (1500, 30.035), (0, 97.0), (1, 97.02), (-1, 999.0)]


@pytest.mark.parametrize(("row", "t"), WRONG)
def test_a_row_whose_stamp_is_wrong_stands_in_its_place(row, t, live, tmp_path, capsys):
    """A stream gives the lines of sound stamps; but without its first row, which has no place yet."""
    study, record = live
    titles, *lines = Path(record).read_bytes().splitlines(keepends=True)
    wrong = [*lines]
    wrong[row] = b"%r" % t + lines[row][lines[row].index(b",") :]
    found = []
    for name, each in (("sound", lines[1 + row :] if row in (0, 1) else lines), ("wrong", wrong)):
        (tmp_path / f"{name}.csv").write_bytes(b"".join([titles, *each]))
        capsys.readouterr()
        command = ["calibrate", "strapdown", str(tmp_path / f"{name}.csv"), "--study", study, "--stream"]
        assert run(command) == 0
        found.append(capsys.readouterr())
    assert found[0].out.count("\n") > 5
    assert found[1].out == found[0].out
    assert found[1].err.count("outlying_time") == 1


@pytest.mark.parametrize(("row", "t"), WRONG)
def test_stamps_of_a_file_are_put_on_the_steps_of_those_beside(row, t, live):
    record = ic.read(live[1])
    column = record["gyro_x"]
    stamps = column.t.copy()
    stamps[row] = t
    found = evened(ic.record({"t [s]": stamps, "gyro_x [rad/s]": column.values}))
    np.testing.assert_allclose(found["gyro_x"].t, column.t, atol=1e-9)
    (finding,) = (each for each in found.findings if each.code == "outlying_time")
    assert finding.where == f"row {row % len(stamps) + 1}"


@pytest.mark.parametrize("change", ["none", "gap", "two gaps", "jitter", "drift"])
def test_sound_stamps_stay(change):
    """Whatever the calibration then says of them."""
    t = 0.02 * np.arange(3000)
    match change:
        case "gap":
            t[1000:] += 0.4
        case "two gaps":
            t[1000:] += 0.4
            t[1001:] += 7.0
        case "jitter":
            t += np.random.default_rng(4).uniform(-0.0049, 0.0049, len(t))
        case "drift":
            t *= 1.0 + 1e-5 * np.arange(len(t)) / len(t)
    record = ic.record(t=t, gyro_x=np.sin(t))
    found = evened(record)
    assert found["gyro_x"].t.tobytes() == t.tobytes()
    assert found.findings == record.findings
