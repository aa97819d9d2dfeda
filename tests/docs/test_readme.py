"""Every command of the README runs as written, on recordings such as a user has: its own, and those that ship.

Only the thousand runs of a campaign are a hundred here.
"""

import gzip
import io
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from certified import LAB

from inercal.cli import run
from inercal.examples import FOLDER
from inercal.foundation.records.read import read
from inercal.foundation.records.write import write_record
from inercal.laboratory.catalog import results
from inercal.laboratory.store import open_store
from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
HEADINGS = (
    "Your own recording",
    "On a turntable",
    "On its own gimbals",
    "In a wind tunnel",
    "In the laboratory",
)
#: of "Many units, many machines", run by the page calibrate-a-fleet.md and by test_cluster; and the one command of
#: "Before you rely on it", which takes some ten seconds and is run by test_validate_command
RUN_ELSEWHERE = [
    "inercal batch fleet.csv --study imu.toml --out fleet",
    "inercal batch fleet.csv --study imu.toml --out fleet --cluster tcp://10.0.0.5:8786",
    "inercal validate --report validation.html",
]


def commands(heading: str) -> list[str]:
    """The lines of a section that begin with ``inercal``, without their comments."""
    section = README.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^    (inercal .*?)(?: {2,}#.*)?$", section, re.MULTILINE)


def instrument(folder: Path) -> None:
    """Recordings of one instrument: a logger's own file, three in columns that name their units, rest, a sweep."""
    rng = np.random.default_rng(20261121)
    truth = draw_truth(rng)
    for name in ("run1", "run2", "run3"):
        record, _ = simulate(truth, hand_poses(rng, 24), 9.81, 0.8, rng, rate=50.0)
        write_record(record, folder / f"{name}.csv")
        if name == "run1":
            rows = (folder / "run1.csv").read_text("utf-8").split("\n")
            (folder / "log.csv").write_text("\n".join(["time,ax,ay,az,gx,gy,gz", *rows[1:]]), "utf-8")
            (folder / "device").write_text("\n".join(rows[:300]) + "\n", "utf-8")
    rest = np.column_stack([np.arange(20_000) / 100.0, 1e-3 * rng.standard_normal(20_000)])
    np.savetxt(folder / "static.csv", rest, delimiter=",", header="t [s],gyro_x [rad/s]", comments="")
    write_record(read(FOLDER / "thermal.csv.gz", FOLDER / "thermal-map.toml"), folder / "sweep.csv")


def prepare(heading: str, folder: Path) -> None:
    """What the reader of a section has beside the README."""
    if heading == "Your own recording":
        instrument(folder)
        # of sound pairs one in twenty differs: run1 and run2 do (p = 0.02)
        for run_, out in (("run1", "before"), ("run3", "after")):
            (folder / "known.toml").write_text(
                '[site]\ngravity = "9.81(1) m/s^2"\nlatitude = "0.8 rad"\n', "utf-8"
            )
            arguments = ["calibrate", "imu", f"{run_}.csv", "--study", "known.toml", "--out", f"{out}.json"]
            assert run([*arguments, "--quiet"]) == 0
        (folder / "known.toml").unlink()
    if heading == "In the laboratory":
        instrument(folder)
        shutil.copy(folder / "run1.csv", folder / "log.csv")
        item = '[item]\nmaker = "M"\nmodel = "G"\nserial = "1234"\n[traceability]\ndate = "2026-01-30"\n'
        site = '[site]\ngravity = "9.81(1) m/s^2"\nlatitude = "0.8 rad"\n'
        (folder / "imu.toml").write_text(site + item, "utf-8")
        (folder / "lab.toml").write_text(LAB, "utf-8")
    for example in ("selfcal", "sting"):
        if any(example in line for line in commands(heading)):
            with (
                gzip.open(FOLDER / f"{example}.csv.gz", "rb") as packed,
                open(folder / "device", "wb") as plain,
            ):
                shutil.copyfileobj(packed, plain)


@pytest.mark.slow
@pytest.mark.parametrize("heading", HEADINGS)
def test_the_commands_run(heading, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    prepare(heading, tmp_path)
    lines = commands(heading)
    assert lines
    for line in lines:
        words, _, source = line.replace("--runs 1000", "--runs 100").partition(" < ")
        if "6fee8a0a58" in words:
            words = words.replace("6fee8a0a58", results(open_store("lab"))[0].id[:10])
        given = (tmp_path / source).read_text("utf-8") if source else ""
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(given.encode())))
        code = run(shlex.split(words)[1:])
        assert code == 0, f"{line}\n{capsys.readouterr().err}"


def test_no_command_is_left_out():
    everywhere = re.findall(r"^    inercal .*$", README, re.MULTILINE)
    elsewhere = [
        line
        for heading in ("Many units, many machines", "Before you rely on it")
        for line in commands(heading)
    ]
    assert elsewhere == RUN_ELSEWHERE
    assert len(everywhere) == sum(len(commands(heading)) for heading in HEADINGS) + len(RUN_ELSEWHERE)
