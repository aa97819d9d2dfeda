"""Spoiled files never show a traceback and never leave half an output: the whole command, on mutated input."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inercal.cli import run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    from inercal.foundation.records.write import write_record
    from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate

    path = tmp_path_factory.mktemp("spoiled")
    rng = np.random.default_rng(3)
    record, _ = simulate(
        draw_truth(rng), hand_poses(rng, 11), 9.81, 0.8, rng, rate=20.0, start=10.0, hold=2.5, turn=1.5
    )
    write_record(record, path / "log.csv")
    (path / "imu.toml").write_text(
        '[site]\ngravity = "9.81(1) m/s^2"\n[imu]\nstatic_start = "9 s"\n', "utf-8"
    )
    return path


mutation = st.tuples(
    st.sampled_from(["cut", "flip", "drop", "twice", "junk", "nan", "swap", "scale"]), st.integers(0, 2**31)
)


def mutate(data: bytes, kind: str, seed: int) -> bytes:
    rng = np.random.default_rng(seed)
    lines = data.split(b"\n")
    k = int(rng.integers(len(lines)))
    match kind:
        case "cut":
            return data[: int(rng.integers(len(data) + 1))]
        case "flip":
            spoiled = bytearray(data)
            for place in rng.integers(0, len(data), int(rng.integers(1, 40))):
                spoiled[place] = int(rng.integers(256))
            return bytes(spoiled)
        case "drop":
            return b"\n".join(lines[:k] + lines[k + int(rng.integers(1, 200)) :])
        case "twice":
            return b"\n".join(lines[: k + 1] + lines[max(0, k - 20) :])
        case "junk":
            return b"\n".join([*lines[:k], rng.bytes(200), *lines[k:]])
        case "nan":
            return b"\n".join([*lines[:k], b"nan,nan,,nan,inf,-inf,nan", *lines[k:]])
        case "swap":
            rng.shuffle(lines[1:])
            return b"\n".join(lines[:1] + [lines[i] for i in rng.permutation(len(lines) - 1) + 1])
        case _:
            header, *rows = lines
            factor = float(10.0 ** rng.integers(-320, 300))
            return b"\n".join(
                [
                    header,
                    *(
                        b",".join(
                            [x.split(b",")[0], *(repr(float(v) * factor).encode() for v in x.split(b",")[1:])]
                        )
                        for x in rows
                        if x
                    ),
                ]
            )


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(change=mutation)
def test_a_spoiled_recording_ends_with_a_verdict_or_one_line(folder, capsys, change):
    spoiled, out = folder / "spoiled.csv", folder / "cal.json"
    spoiled.write_bytes(mutate((folder / "log.csv").read_bytes(), *change))
    out.unlink(missing_ok=True)
    code = run(
        ["calibrate", "imu", str(spoiled), "--study", str(folder / "imu.toml"), "--json", "--out", str(out)]
    )
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    assert "a fault of inercal's own" not in captured.err, captured.err
    if code == 2:
        assert captured.out == ""
        assert captured.err.count("\n") == 1
        assert captured.err.startswith("inercal: error: ")
        assert not out.exists()
    else:
        data = json.loads(captured.out)
        assert (data["status"]["code"] == "ok") == (code == 0)
        assert json.loads(out.read_text())["status"] == data["status"]
        if code == 0:
            assert all(p["u"] > 0 and np.isfinite(p["value"]) for p in data["parameters"])
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(change=mutation)
def test_a_spoiled_study_ends_with_a_verdict_or_one_line(folder, capsys, change):
    spoiled = folder / "spoiled.toml"
    spoiled.write_bytes(
        mutate((folder / "imu.toml").read_bytes(), *change) if change[0] != "scale" else b"[site"
    )
    code = run(["calibrate", "imu", str(folder / "log.csv"), "--study", str(spoiled), "--json", "--quiet"])
    captured = capsys.readouterr()
    assert "a fault of inercal's own" not in captured.err, captured.err
    if code == 2:
        assert captured.out == ""
        assert captured.err.count("\n") == 1
    else:
        json.loads(captured.out)
