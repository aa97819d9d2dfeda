"""The command line at its edges: closed streams, odd encodings, outputs that would take an input's place."""

import json
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
from new_studies import filled

from inercal.cli import run
from rows import for_each

POSIX = pytest.mark.skipif(os.name == "nt", reason="a shell and file names as on POSIX")
CSV = "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]\n"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder to work in, with a recording (one value is missing), a study, a map and a calibration."""
    monkeypatch.chdir(tmp_path)
    rows = [f"{i / 10},0.1,0.2,9.8,{i % 3},{i % 5},0.3" for i in range(50)]
    rows[20] = rows[20].replace(",0.2,", ",,")
    Path("log.csv").write_text(CSV + "\n".join(rows) + "\n")
    Path("imu.toml").write_text(filled("imu"), "utf-8")
    columns = [f"[columns.{name.split(' [')[0]}]\nfrom = {name!r}" for name in CSV.strip().split(",")]
    units = [name.split("[")[1][:-1] for name in CSV.strip().split(",")]
    Path("map.toml").write_text("".join(f'{c}\nunit = "{u}"\n' for c, u in zip(columns, units, strict=True)))
    calibration(Path("cal.json"))
    return tmp_path


def calibration(path: Path, scale: float = 1.0) -> None:
    """Write a calibration of an instrument without errors."""
    names = [f"{name}_{axis}" for name in ("K1", "S") for axis in "xyz"]
    parameters = [{"name": name, "value": scale, "u": 0.1, "unit": "1"} for name in names]
    whole = {
        "command": "calibrate imu",
        "status": {"code": "ok", "message": ""},
        "parameters": parameters,
        "covariance": {"names": names, "matrix": [[0.0] * 6] * 6},
        "result": {"unit": {"acc": "m/s^2", "gyro": "rad/s"}},
    }
    path.write_text(json.dumps(whole))


def refused(arguments: list[str], capsys, *words: str) -> None:
    """Exit code 2, nothing on standard output, one line with the words on standard error."""
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith("inercal: error: ")
    for word in words:
        assert word in captured.err


def shell(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command line in a shell with this environment alone; INERCAL stands for the command."""
    kept = {key: os.environ[key] for key in ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH") if key in os.environ}
    return subprocess.run(
        ["sh", "-c", command],
        env={**kept, **environment, "INERCAL": f"{sys.executable} -m inercal"},
        capture_output=True,
        encoding="utf-8",
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize("out", ["imu.toml", "./imu.toml", "map.toml", "link.toml"])
def test_no_output_takes_the_place_of_an_input(out, folder, capsys):
    Path("link.toml").symlink_to("imu.toml")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    command = ["calibrate", "imu", "log.csv", "--study", "imu.toml", "--map", "map.toml"]
    refused([*command, "--out", out], capsys, f"{Path(out)}: is an input, expected another file")
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_apply_spares_the_recording_also_where_only_the_map_names_it(folder, capsys):
    before = Path("log.csv").read_bytes()
    refused(["apply", "cal.json", "log.csv", "--out", str(folder / "log.csv")], capsys, "is an input")
    plain = Path("map.toml").read_text().replace("[columns.", "[file.a.columns.")
    Path("named.toml").write_text(f'[file.a]\npath = "log.csv"\n{plain}')
    Path("other").mkdir()
    Path("other/log.csv").write_bytes(before)
    command = ["apply", "cal.json", "other/log.csv", "--map", "named.toml", "--out"]
    refused([*command, "other/log.csv"], capsys, "is an input")
    Path("b.toml").write_text(
        f'[file.a]\npath = "log.csv"\n{plain}[file.b]\npath = "b.csv"\n'
        '[file.b.columns.temperature]\nfrom = 0\nunit = "degC"\n[file.b.columns.t]\nfrom = 1\nunit = "s"\n'
    )
    Path("b.csv").write_text("".join(f"20,{i / 10}\n" for i in range(50)))
    refused(["apply", "cal.json", "log.csv", "--map", "b.toml", "--out", "b.csv"], capsys, "is an input")
    assert Path("log.csv").read_bytes() == before


def test_a_singular_calibration_is_named(folder, capsys):
    calibration(Path("flat.json"), 0.0)
    refused(["apply", "flat.json", "log.csv", "--out", "x.csv"], capsys, "flat.json: ", "cannot be inverted")


def test_apply_says_the_findings_and_keeps_the_rate_where_a_specific_force_is_missing(folder, capsys):
    assert run(["apply", "cal.json", "log.csv", "--out", "x.csv"]) == 0
    assert "more findings: --json has all" in capsys.readouterr().err
    assert run(["apply", "cal.json", "log.csv", "--out", "x.csv", "--json"]) == 0
    assert "nan" in [finding["code"] for finding in json.loads(capsys.readouterr().out)["findings"]]
    assert Path("x.csv").read_text().splitlines()[21].startswith("2.0,,,,2.0,0.0,0.3")
    assert run(["apply", "cal.json", "log.csv", "--out", "x.csv", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_apply_says_what_of_the_calibration_it_does_not_use(folder, capsys):
    """On standard error, in the JSON object, and in a stream: a drift of the bias, and a bad verdict."""
    whole = json.loads(Path("cal.json").read_text())
    whole["parameters"] += [{"name": f"D_R_{i}", "value": 1e-3, "u": 0.1, "unit": "1"} for i in "xyz"]
    names = [each["name"] for each in whole["parameters"]]
    whole |= {
        "covariance": {"names": names, "matrix": [[0.0] * 9] * 9},
        "status": {"code": "inconsistent", "message": "no"},
    }
    whole["result"]["bias_time_s"] = 12.5
    Path("drift.json").write_text(json.dumps(whole))
    assert run(["apply", "drift.json", "log.csv", "--out", "x.csv", "--json"]) == 0
    captured = capsys.readouterr()
    findings = json.loads(captured.out)["findings"]
    assert [finding["code"] for finding in findings[:2]] == ["bad_verdict", "not_held"]
    assert "D_F is the bias at 12.5 s" in findings[1]["message"]
    assert run(["apply", "drift.json", "log.csv", "--stream"]) == 0
    verdict = "bad_verdict: the calibration ended inconsistent: no (drift.json)\n"
    assert captured.err.startswith(verdict)
    assert capsys.readouterr().err.startswith(f"{verdict}not_held: the drift D_R")


@pytest.mark.parametrize(
    ("arguments", "command", "inputs"),
    [
        (["new", "imu", "log.csv", "--out", "new.toml"], "new imu", ["log.csv"]),
        (["new", "imu", "--out", "new.toml"], "new imu", []),
        (["inspect", "log.csv", "--map", "map.toml"], "inspect", ["log.csv", "map.toml"]),
        (["apply", "cal.json", "log.csv", "--out", "x.csv"], "apply", ["log.csv", "cal.json"]),
        (["examples"], "examples", []),
    ],
)
def test_every_json_has_the_common_keys(arguments, command, inputs, folder, capsys):
    assert run([*arguments, "--json", "--quiet"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert list(data) == [
        "inercal", "command", "status", "parameters", "covariance", "findings", "statistics", "budget", "model",
        "conditions", "traceability", "inputs", "timing_s", "provenance", "references", "result",
    ]  # fmt: skip
    assert data["command"] == command
    assert data["status"]["code"] == "ok"
    assert data["status"]["message"]
    assert [source["path"] for source in data["inputs"]] == inputs
    assert all(len(source["sha256"]) == 64 for source in data["inputs"])
    assert data["timing_s"]["total"] > 0


@pytest.mark.parametrize("command", [["new", "imu"], ["apply"], ["schema"], ["examples"]])
def test_only_what_can_write_a_report_offers_one(command, folder, capsys):
    assert run([*command, "--help"]) == 0
    assert "--report" not in capsys.readouterr().out
    refused([*command, "--report", "x.html"], capsys, "--report")


def test_examples_without_a_name_have_nothing_to_copy(folder, capsys):
    refused(["examples", "--out", "zz"], capsys, "--out", "expected its name")


def test_schema_goes_to_a_file_and_as_json_to_standard_output_too(folder, capsys):
    assert run(["schema", "--out", "s.json", "--json", "--quiet"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(Path("s.json").read_text())


@for_each(
    ("arguments", "words"),
    [
        (["calibrate"], ["calibrate", "expected imu"]),
        (["new"], ["new", "expected imu"]),
        (["new", "--json"], ["new", "expected imu"]),
        (["inspect", ""], ["after inspect", "empty"]),
        (["calibrate", "imu", "log.csv", "--study", ""], ["after --study", "empty"]),
        (["calibrate", "imu", "log.csv", "--study="], ["after --study", "empty"]),
        ([""], ["empty"]),
    ],
)
def test_what_is_missing_is_said(arguments, words, folder, capsys):
    refused(arguments, capsys, *words)


def test_without_a_command_there_is_help(capsys):
    assert run([]) == 0
    assert "calibrate" in capsys.readouterr().out


def test_a_decimal_comma_is_recognised(folder, capsys):
    command = ["calibrate", "imu", "log.csv", "--study", "imu.toml", "--set"]
    refused([*command, "site.gravity=9,81 m/s^2"], capsys, "site.gravity", "decimal point")


def test_new_names_the_files_it_wrote_and_asks_for_the_rate(folder, capsys):
    rows = (f"0.{i % 7},0.2,9.8,0.00{i % 5},0.001,0.002\n" for i in range(5000))  # samples, not rows of means
    Path("raw.csv").write_text(
        "acc_x,acc_y,acc_z,gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]\n" + "".join(rows)
    )
    assert run(["new", "imu", "raw.csv", "--set", "site.latitude=48 deg", "--out", "my.toml"]) == 0
    next_line = "# Next: inercal calibrate imu raw.csv --map my-map.toml --study my.toml\n"
    assert next_line in Path("my.toml").read_text("utf-8")
    capsys.readouterr()
    command = ["calibrate", "imu", "raw.csv", "--map", "my-map.toml", "--study", "my.toml"]
    refused(command, capsys, "raw.csv: found no time column t", '--answer "rate=100 Hz"')


def test_new_says_that_no_sensor_was_recognised(folder, capsys):
    """A temperature alone is nothing to calibrate: the map lists the columns, and is refused as it is."""
    Path("raw.csv").write_text("temp,strain\n" + "".join(f"2{i % 7}.5,0.{i % 3}\n" for i in range(50)))
    assert run(["new", "imu", "raw.csv", "--out", "my.toml"]) == 0
    assert "no accelerometer or gyro was recognised: the map lists the columns" in capsys.readouterr().out
    assert '"strain" (0, 0.1, 0.2)' in Path("my-map.toml").read_text("utf-8")
    refused(["inspect", "raw.csv", "--map", "my-map.toml"], capsys, "columns: missing")


@POSIX
def test_standard_output_may_be_closed(folder):
    done = shell("$INERCAL inspect log.csv >&-")
    assert done.returncode == 2
    assert done.stderr == "inercal: error: standard output: found it closed, expected it open\n"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
@pytest.mark.parametrize(
    "command",
    [
        "apply cal.json log.csv --out x.csv",
        *(
            pytest.param(each, marks=pytest.mark.campaign)
            for each in (
                "inspect log.csv --report r.html",
                "convert cal.json --to kalibr --out k.yaml",
                "allan log.csv --out n.json",
            )
        ),
    ],
)
def test_json_that_cannot_be_written_is_one_line(command, folder):
    """Findings and names of files are said once the object is out; else the error stands alone."""
    done = shell(f"$INERCAL {command} --json")
    assert done.returncode == 0
    assert done.stderr
    done = shell(f"$INERCAL {command} --json > /dev/full")
    assert done.returncode == 2
    assert done.stderr.startswith("inercal: error: standard output: ")
    assert done.stderr.count("\n") == 1, done.stderr


@POSIX
def test_standard_error_may_be_closed(folder):
    done = shell("$INERCAL inspect log.csv 2>&-")
    assert done.returncode == 0
    assert "acc_x" in done.stdout
    assert shell("$INERCAL inspect no.csv 2>&-").returncode == 2


@pytest.mark.slow
@POSIX
def test_no_encoding_is_too_poor(folder):
    """Also without UTF-8 whatever is said can be printed, and files are written in UTF-8."""
    poor = {"PYTHONUTF8": "0", "LC_ALL": "C"}
    Path("ü").mkdir()
    Path("ü/lög.csv").write_bytes(Path("log.csv").read_bytes())
    done = shell("$INERCAL inspect ü/lög.csv --report ü/r.html", **poor)
    assert (done.returncode, done.stderr.count("\n")) == (0, 1), done.stderr
    assert "lög.csv" in Path("ü/r.html").read_text("utf-8")
    done = shell("$INERCAL inspect ü/lög.csv --json", PYTHONIOENCODING="ascii")
    assert json.loads(done.stdout)["inputs"][0]["path"] == "ü/lög.csv"
    done = shell("$INERCAL new imu ü/lög.csv --out ü/new.toml", **poor)
    assert done.returncode == 0, done.stderr
    assert "imu ü/lög.csv --map ü/new-map.toml" in Path("ü/new.toml").read_text("utf-8").replace("'", "")
    assert "lög.csv" in Path("ü/new-map.toml").read_text("utf-8")


def test_matplotlib_is_told_to_be_quiet(capsys):
    run(["examples"])
    assert not logging.getLogger("matplotlib").isEnabledFor(logging.WARNING)


@for_each("name", ["inspect", "apply", "convert", "compare"])
def test_control_characters_of_files_stay_in_their_files(name, folder, capsys):
    """A name in a foreign file must not clear the screen, set the title of the terminal, or turn its text."""
    evil = "\x1b[2J\x1b]0;pwned\x07\u202egnp\u009b31m"
    Path("evil.csv").write_text(CSV.replace("acc_x", f"a{evil}") + "0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n", "utf-8")
    whole = json.loads(Path("cal.json").read_text("utf-8"))
    whole["status"]["message"] = whole["parameters"][0]["name"] = evil
    whole["parameters"][1]["unit"] = whole["command"] = evil
    whole["covariance"] = {"names": [each["name"] for each in whole["parameters"]], "matrix": []}
    Path("evil.json").write_text(json.dumps(whole), "utf-8")
    Path("map.toml").write_text('[columns]\nacc_x = { from = "none", unit = "g" }\n[time]\nrate = "1 Hz"\n')
    words = {
        "inspect": "inspect evil.csv --map map.toml",
        "apply": "apply evil.json log.csv --out out.csv",
        "convert": "convert evil.json --to kalibr --out out.yaml",
        "compare": "compare evil.json cal.json",
    }
    capsys.readouterr()
    run(words[name].split())
    out, err = capsys.readouterr()
    assert not set("\x1b\x07\u202e\u009b") & set(out + err)
    assert out + err


def test_an_error_line_has_an_end(folder, capsys):
    """Lines of 4.7 kB came of long names."""
    Path("long.csv").write_text(
        ",".join(f"{'x' * 150}{k}" for k in range(40)) + "\n" + ",".join("1" * 40) + "\n"
    )
    Path("map.toml").write_text('[columns]\nacc_x = { from = "none", unit = "g" }\n[time]\nrate = "1 Hz"\n')
    assert run(["inspect", "long.csv", "--map", "map.toml"]) == 2
    err = capsys.readouterr().err
    assert len(err) < 1000
    assert err.endswith("expected it there\n")
