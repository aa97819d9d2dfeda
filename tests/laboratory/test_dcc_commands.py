"""Certificates as somebody types them: of simulated instruments of every kind, written, read, used."""

import json
import tomllib

import numpy as np
import pytest
from certified import LAB

from inercal.cli import run
from inercal.examples import FOLDER
from inercal.foundation.results.files import load
from rows import for_each

#: kind -> options of the simulation, and the command that calibrates
KINDS = {
    "imu": ([], "calibrate imu"),
    "turntable": ([], "calibrate turntable"),
    "selfcal": ([], "selfcal"),
    "strapdown": ([], "calibrate strapdown"),
    "aoa": (["--set", "motion.duration=10 s"], "aoa"),
}
TABLES = ["traceability.date=2026-01-30", "item.maker=M", "item.model=G", "item.serial=S5"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the file of a laboratory, in which the commands run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab.toml").write_text(LAB)
    return tmp_path


def result_of(kind):
    """A result of a simulated instrument, in ``result.json``."""
    options, command = KINDS[kind]
    sets = [word for each in ("site.latitude=48 deg", *TABLES) for word in ("--set", each)]
    assert run(["new", kind, *sets, "--out", "study.toml", "--quiet"]) == 0
    simulated = ["simulate", kind, "study.toml", "--seed", "1", "--out", "record.csv"]
    assert run([*simulated, *options, "--quiet"]) == 0
    assert (
        run([*command.split(), "record.csv", "--study", "study.toml", "--out", "result.json", "--quiet"]) == 0
    )
    return load("result.json")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_an_instrument_of_every_kind(folder, capsys, kind):
    """Valid by the schema, the item that of the study; the numbers read back are those of the result."""
    estimate = result_of(kind)
    write = [
        "certificate",
        "result.json",
        "--lab",
        "lab.toml",
        "--number",
        "C-1",
        "--out",
        "c.xml",
        "--html",
        "c.html",
    ]
    assert run(write) == 0
    capsys.readouterr()
    assert run(["certificate", "--read", "c.xml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["result"]
    assert found["validated"] is True
    assert found["item"] == "M G S5"
    (one,) = found["results"]
    assert [each["label"] for each in one["quantities"]] == list(estimate.names)
    assert [each["value"] for each in one["quantities"]] == estimate.values.tolist()
    assert np.array_equal(one["covariance"]["covariance"], estimate.covariance)
    assert all(each["reference_types"][0].startswith("inertial_") for each in one["quantities"])
    page = (folder / "c.html").read_text()
    assert all(name in page for name in estimate.names)


def test_a_certificate_is_applied_and_compared(folder, capsys):
    names = ("ferraris.csv.gz", "ferraris-map.toml", "ferraris.toml")
    for name in names:
        (folder / name).write_bytes((FOLDER / name).read_bytes())
    recorded = ["ferraris.csv.gz", "--map", "ferraris-map.toml"]
    sets = ["--set", "item.model=node", "--set", "item.serial=S7"]
    assert run(["calibrate", "imu", *recorded, "--study", "ferraris.toml", *sets, "--out", "r.json"]) == 0
    data = json.loads((folder / "r.json").read_text())
    assert {key: data["traceability"][key] for key in ("model", "serial")} == {
        "model": "node",
        "serial": "S7",
    }
    assert run(["certificate", "r.json", "--lab", "lab.toml", "--number", "1", "--out", "c.xml"]) == 0
    for calibration, out in (("r.json", "a.csv"), ("c.xml", "b.csv")):
        assert run(["apply", calibration, *recorded, "--out", out]) == 0
    assert (folder / "a.csv").read_bytes() == (folder / "b.csv").read_bytes()
    assert run(["compare", "c.xml", "r.json"]) == 0
    assert "all 36 together with a probability of 1" in capsys.readouterr().out


WRITE = ["certificate", "r.json", "--lab", "lab.toml", "--number", "1", "--out", "c.xml"]


@for_each(
    ("words", "said"),
    [
        (["certificate"], "RESULTS: missing"),
        (["certificate", "r.json"], "--lab: missing"),
        (["certificate", "r.json", "--lab", "lab.toml"], "--number: missing"),
        (["certificate", "--read", "c.xml", "--number", "1"], "--number: found with --read"),
        ([*WRITE[:-1], "c.pdf"], "found the suffix '.pdf' for --out"),
        ([*WRITE, "--html", "c.txt"], "found the suffix '.txt' for --html"),
        ([*WRITE, "--page", "a.html", "--page", "b.html"], "--page: found 2 of 1 results"),
        ([*WRITE, "--page", "none.html"], "none.html: cannot be read"),
        (["certificate", "--read", "none.xml"], "none.xml: cannot be read"),
        (["certificate", "none.json", *WRITE[2:]], "none.json: cannot be read"),
    ],
)
def test_refusals(folder, capsys, words, said):
    (folder / "r.json").write_bytes(minimal())
    assert run(words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (folder / "c.xml").exists()


def minimal():
    """The JSON of a result that is ok."""
    from made import result

    from inercal.foundation.results.files import to_json

    return json.dumps(to_json(result())).encode()


def test_a_new_lab_and_nothing_overwritten(folder, capsys):
    assert run(["new", "lab"]) == 2
    assert "lab.toml: exists already" in capsys.readouterr().err
    assert (
        run(
            ["new", "lab", "--out", "mine.toml", "--set", "customer.name=Flight", "--set", "order.number=A-1"]
        )
        == 0
    )
    assert 'fill in each "?"' in capsys.readouterr().out
    stated = tomllib.loads((folder / "mine.toml").read_text())
    assert (stated["laboratory"]["name"], stated["customer"]["name"], stated["order"]["number"]) == (
        "?",
        "Flight",
        "A-1",
    )
    assert run(["new", "lab", "--out", "other.toml", "--set", "customer.nme=x"]) == 2
    assert "customer.nme: unknown key, did you mean name?" in capsys.readouterr().err
