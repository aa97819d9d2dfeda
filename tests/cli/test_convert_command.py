"""``inercal convert``: files that other tools read, their files read, and one line for what is wrong."""

import json

import numpy as np
import pytest

from inercal.cli import run
from inercal.faces.convert.correct import ImuModel
from inercal.faces.convert.other_tools import CONVENTIONS
from inercal.foundation.findings import Status
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.results.files import load, save
from inercal.foundation.results.result import Estimate
from rows import for_each

NAMES = (
    *(f"{term}_{axis}" for term in ("K0", "K1", "D_F", "S") for axis in "xyz"),
    *("M_xy", "M_xz", "M_yz", "T_xy", "T_xz", "T_yx", "T_yz", "T_zx", "T_zy"),
)
VALUES = np.array([
    33000, 33100, 32900, 414, 412, 415, 32800, 32700, 32600, 4770, 4760, 4780,
    0.003, 0.009, 0.021, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006,
])  # fmt: skip


def calibration(status=Status.OK):
    """A calibration of counts, each coefficient known to a millionth."""
    return Estimate(
        "calibrate imu", NAMES, ("1",) * 21, VALUES, np.diag((1e-6 * VALUES) ** 2), np.full(21, 30.0),
        status, "made", result={"unit": {"acc": "count", "gyro": "count"}},
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save(calibration(), "cal.json")
    save(calibration(), "cal.toml")
    triads = [VALUES[:3], VALUES[3:6], VALUES[6:9], VALUES[9:12]]
    M, T = np.eye(3), np.eye(3)
    M[np.triu_indices(3, 1)] = VALUES[12:15]
    T[~np.eye(3, dtype=bool)] = VALUES[15:]
    model = ImuModel(
        TriadModel(triads[1], M, triads[0]), TriadModel(triads[3], T, triads[2]), np.zeros((3, 3)), {}
    )
    rng = np.random.default_rng(5)
    f, omega = rng.uniform(-9, 9, (60, 3)), rng.uniform(-1, 1, (60, 3))
    rows = np.column_stack([np.arange(60) / 50, *model.indicate(f, omega)])
    head = "t [s]," + ",".join(f"{s}_{a} [count]" for s in ("acc", "gyro") for a in "xyz")
    np.savetxt("log.csv", rows, delimiter=",", header=head, comments="", fmt="%.17g")
    np.save("true.npy", np.hstack([f, omega]))
    return tmp_path


FILES = {
    "imu_tk": ["theirs_acc.calib", "theirs_gyro.calib"],
    "imucal": ["theirs.json"],
    "kalibr": ["theirs.yaml"],
    "psins": ["theirs.m"],
}


@pytest.mark.parametrize("back", ["back.json", "back.toml"])
@pytest.mark.parametrize("tool", CONVENTIONS)
def test_to_a_tool_and_back_the_same_samples_come_out_of_apply(folder, capsys, tool, back):
    out = "theirs" + CONVENTIONS[tool].suffixes[0]
    assert run(["convert", "cal.json", "--to", tool, "--out", out]) == 0
    written = [line for line in capsys.readouterr().err.splitlines() if line.startswith(f"{tool}: ")]
    assert written == [f"{tool}: {name}" for name in FILES[tool]]
    assert run(["convert", *FILES[tool], "--from", tool, "--out", back]) == 0
    assert "not_stated: a file of" in capsys.readouterr().err
    assert run(["apply", back, "log.csv", "--out", "true.csv", "--quiet"]) == 0
    found = np.loadtxt("true.csv", delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_allclose(found, np.load("true.npy"), atol=1e-9)
    assert load(back).command == "convert"


def test_apply_takes_a_calibration_in_toml(folder, capsys):
    for name in ("cal.json", "cal.toml"):
        assert run(["apply", name, "log.csv", "--out", f"{name}.csv", "--quiet"]) == 0
    assert (folder / "cal.json.csv").read_text() == (folder / "cal.toml.csv").read_text()


@pytest.mark.parametrize("tool", CONVENTIONS)
def test_without_out_the_text_is_on_standard_output_and_nothing_else(folder, capsys, tool):
    assert run(["convert", "cal.json", "--to", tool, "--quiet"]) == 0
    out = capsys.readouterr().out
    assert (
        run(["convert", "cal.json", "--to", tool, "--out", "x" + CONVENTIONS[tool].suffixes[0], "--quiet"])
        == 0
    )
    texts = [path.read_text() for path in sorted(folder.glob("x*"))]
    assert out == "\n".join(texts)


def test_the_json_result_holds_the_terms_with_their_covariance_and_the_text(folder, capsys):
    assert run(["convert", "cal.json", "--to", "imu_tk", "--json", "--quiet"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["command"] == "convert"
    assert data["covariance"]["names"] == [p["name"] for p in data["parameters"]]
    K = next(p for p in data["parameters"] if p["name"] == "K_a_xx")
    assert K["value"] == pytest.approx(1 / 414)
    assert K["u"] == pytest.approx(1e-6 / 414)
    assert (K["unit"], K["dof"]) == ("(m/s^2)/count", 30)
    assert data["result"]["convention"] == "imu_tk"
    assert data["result"]["files"] == []
    assert len(data["result"]["texts"]) == 2
    assert data["inputs"][0]["path"] == "cal.json"
    assert data["timing_s"]["total"] > 0


def test_an_uncertainty_that_is_not_known_is_null(folder, capsys):
    run(["convert", "cal.json", "--to", "imucal", "--out", "theirs.json", "--quiet"])
    capsys.readouterr()
    assert run(["convert", "theirs.json", "--from", "imucal", "--json", "--quiet"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert {p["u"] for p in data["parameters"]} == {None}
    assert data["status"]["code"] == "ok"
    assert [finding["code"] for finding in data["findings"]] == ["not_stated"]


def test_from_one_tool_to_another(folder, capsys):
    run(["convert", "cal.json", "--to", "psins", "--out", "theirs.m", "--quiet"])
    capsys.readouterr()
    assert (
        run(["convert", "theirs.m", "--from", "psins", "--to", "kalibr", "--out", "k.yaml", "--quiet"]) == 0
    )
    assert "nan" not in (folder / "k.yaml").read_text()


def test_a_bad_verdict_goes_along(folder, capsys):
    save(calibration(Status.ILL_CONDITIONED), "weak.json")
    assert run(["convert", "weak.json", "--to", "psins", "--json"]) == 1
    captured = capsys.readouterr()
    assert json.loads(captured.out)["status"]["code"] == "ill_conditioned"
    assert "ill_conditioned" in captured.err


@for_each(
    ("arguments", "words"),
    [
        (["cal.json"], ["--to", "missing", "imu_tk, imucal, kalibr, psins"]),
        (["cal.json", "--to", "matlab"], ["matlab"]),
        (["no.json", "--to", "psins"], ["no.json", "cannot be read"]),
        (["log.csv", "--to", "psins"], ["log.csv", "expected a calibration written by inercal"]),
        (["cal.json", "cal.toml", "--to", "psins"], ["cal.toml", "second calibration"]),
        (["cal.json", "--to", "psins", "--out", "x.json"], ["x.json", "expected .m"]),
        (["cal.json", "--to", "imucal", "--out", "cal.json"], ["cal.json", "is an input"]),
        (["cal.json", "--to", "psins", "--out", "no/x.m"], ["no/x.m", "cannot be written"]),
        (["cal.json", "--to", "psins", "--acc-unit", "count"], ["--acc-unit", "--from"]),
        (["cal.json", "--from", "imucal"], ["cal.json", "expected a calibration written by imucal"]),
        (["log.csv", "--from", "kalibr"], ["log.csv", "expected"]),
        (["log.csv", "--from", "psins"], ["log.csv", "expected Kg, eb, Ka, db"]),
        (["log.csv", "--from", "imu_tk", "--acc-unit", "count"], ["log.csv", "21 numbers"]),
        (["cal.json", "--from", "psins", "--out", "x.yaml"], ["x.yaml", "expected .json or .toml"]),
        (["--to", "psins"], ["convert"]),
    ],
)
def test_bad_usage_is_one_line_and_leaves_nothing(folder, capsys, arguments, words):
    before = {path: path.read_bytes() for path in folder.iterdir()}
    assert run(["convert", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("inercal: error: ")
    for word in words:
        assert word in line
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_a_file_of_imu_tk_is_not_overwritten_by_its_second_name(folder, capsys):
    run(["convert", "cal.json", "--to", "imu_tk", "--out", "x.calib", "--quiet"])
    capsys.readouterr()
    again = [
        "convert",
        "x_acc.calib",
        "x_gyro.calib",
        "--from",
        "imu_tk",
        "--to",
        "imu_tk",
        "--out",
        "x.calib",
    ]
    assert run([*again, "--quiet"]) == 2
    assert "x_acc.calib: is an input" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("count", [50, pytest.param(150, marks=pytest.mark.campaign)])
@pytest.mark.parametrize("tool", CONVENTIONS)
def test_spoiled_files_of_other_tools_end_with_a_calibration_or_one_line(folder, capsys, tool, count):
    run(["convert", "cal.json", "--to", tool, "--out", "theirs" + CONVENTIONS[tool].suffixes[0], "--quiet"])
    rng = np.random.default_rng(6)
    (name, *more) = FILES[tool]
    whole = (folder / name).read_bytes()
    for _ in range(count):
        spoiled = bytearray(whole)
        match rng.integers(4):
            case 0:
                del spoiled[int(rng.integers(len(whole))) :]
            case 1:
                for place in rng.integers(0, len(whole), int(rng.integers(1, 20))):
                    spoiled[place] = int(rng.integers(128))
            case 2:
                a, b = sorted(rng.integers(0, len(whole), 2))
                spoiled[a:b] = spoiled[b : 2 * b - a]
            case _:
                place = int(rng.integers(len(whole)))
                spoiled[place:place] = rng.choice(
                    [b"[", b"nan", b"1e400", b"{", b"\n- ", b"9" * 400, b":", b"%"]
                )
        (folder / name).write_bytes(bytes(spoiled))
        code = run(["convert", name, *more, "--from", tool, "--json", "--quiet"])
        captured = capsys.readouterr()
        assert code in (0, 2), captured.err
        assert "a fault of inercal's own" not in captured.err
        assert len(captured.err.splitlines()) == (0 if code == 0 else 1)


def test_a_gyro_that_is_not_calibrated_is_said(folder, capsys):
    whole = calibration()
    acc = np.array([name[0] in "KM" for name in NAMES])
    save(
        Estimate(
            "calibrate imu", tuple(np.array(NAMES)[acc].tolist()), ("1",) * 9, VALUES[acc],
            whole.covariance[np.ix_(acc, acc)], whole.dof[acc], Status.OK, "made",
            result={"unit": {"acc": "count"}},
        ),
        "acc.json",
    )  # fmt: skip
    assert run(["convert", "acc.json", "--to", "imu_tk", "--out", "x.calib", "--quiet"]) == 0
    assert [path.name for path in folder.glob("x*")] == ["x_acc.calib"]
    for tool in ("imucal", "kalibr", "psins"):
        capsys.readouterr()
        assert run(["convert", "acc.json", "--to", tool]) == 2
        assert "found a calibration of accelerometers alone" in capsys.readouterr().err
