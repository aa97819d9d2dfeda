"""The benchmarks run, their table and picture are written, and the book's figures of speed are rows of that table.

No time is judged here.
"""

import functools
import importlib
import json
import re
import runpy
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from inercal.foundation.errors import InputError

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "benchmarks"
measure, bench, scaling = (importlib.import_module(name) for name in ("measure", "run", "scaling"))

PAGE = ROOT / "docs" / "design" / "benchmarks.md"
"""Where the table of one run is kept."""


PARTS = {**bench.PARTS, "Fleets": "fleets"}
"""Each part of a run, and one that is run alone."""
LONG = ("Commands", "Fleets", "IMU by hand", "Strapdown")


@functools.cache
def quick(title):
    """Rows of a part, little work each."""
    return importlib.import_module(PARTS[title]).rows(True)


def column(text, head):
    """The first cells of all tables of a page whose first head is that."""
    found, inside = [], False
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        inside = line.startswith("|") and (inside or cells[0] == head)
        if inside and cells[0] != head and not cells[0].startswith("---"):
            found.append(cells)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "title",
    [pytest.param(each, marks=[pytest.mark.campaign] * (each in LONG)) for each in PARTS],
)
def test_each_part_gives_rows(title):
    rows = quick(title)
    assert rows
    for row in rows:
        assert row.ours.low <= row.ours.median <= row.ours.high
        assert (row.theirs is None) == (row.ratio is None)
        assert row.ratio is None or row.peer


@pytest.mark.campaign
def test_table_objects_and_picture_are_written(tmp_path):
    made = {title: quick(title) for title in PARTS}
    told = {
        "date": "2026-11-22T00:00:00+00:00",
        "machine": measure.machine(),
        "rows": {title: measure.as_objects(rows) for title, rows in made.items()},
        "curves": scaling.as_objects(scaling.curves(True)),
        "yardstick": asdict(measure.spread([measure.yardstick() for _ in range(3)])),
    }
    told = json.loads(json.dumps(told))
    bench.written(told, tmp_path)
    bench.pictured(told, tmp_path)
    assert json.loads((tmp_path / "results.json").read_text(encoding="utf-8")) == told
    text = (tmp_path / "results.md").read_text(encoding="utf-8")
    rows = [row for part in made.values() for row in part]
    assert [cells[0] for cells in column(text, "Work")] == [row.what for row in rows]
    assert [bench.row_of(each) for part in told["rows"].values() for each in part] == rows
    assert (tmp_path / "cost.svg").read_text(encoding="utf-8").startswith("<svg")


def test_a_ratio_is_taken_within_its_round():
    """A machine that is three times as slow in the second round changes both times, and no ratio."""
    row = measure.row("work", "1", ("ms", 1e3), [0.1, 0.3], "peer", [0.4, 1.2], at_least=4.0)
    assert (row.ratio.low, row.ratio.median, row.ratio.high) == pytest.approx((4.0, 4.0, 4.0))
    assert (row.ours.low, row.ours.high, row.theirs.high) == pytest.approx((100.0, 300.0, 1200.0))
    assert row.holds is (row.ratio.median >= 4.0)
    assert replace(row, at_least=4.1).holds is False
    assert replace(row, at_least=None, at_most=199.0).holds is False
    assert replace(row, at_least=None).holds is None


def test_rounds_alternate_and_the_first_is_not_counted():
    clock, order = iter(range(1000)), []
    works = {name: lambda name=name: order.append(name) for name in "ab"}
    seconds = measure.in_turn(works, 3, lambda: next(clock))
    assert order == ["a", "b"] * 4
    assert {name: len(each) for name, each in seconds.items()} == {"a": 3, "b": 3}


def test_a_slope_is_the_exponent():
    """Of the larger sizes: what a work costs at any size is not its growth."""
    sizes = tuple(10.0**k for k in range(7))
    curve = scaling.Curve("panel", "size", "work", sizes, tuple(2.0 + 3e-2 * n**2 for n in sizes))
    assert curve.slope == pytest.approx(2.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    "titles", [[each for each in PARTS if each not in LONG], pytest.param(LONG, marks=pytest.mark.campaign)]
)
def test_the_page_has_the_rows_that_the_scripts_give(titles):
    """By name: the page's table is of the scripts as they are."""
    known = {cells[0] for cells in column(PAGE.read_text(encoding="utf-8"), "Work")}
    assert {row.what for title in titles for row in quick(title)} <= known


def test_what_the_book_says_of_speed_has_a_row():
    """Each claim that the page lists is said where it says, and its row is in the table."""
    text = PAGE.read_text(encoding="utf-8")
    known, claims = {cells[0] for cells in column(text, "Work")}, column(text, "Said in")
    assert claims
    for link, words, row in (cells[:3] for cells in claims):
        target = (PAGE.parent / re.search(r"\(([^)]+)\)", link)[1]).resolve()
        said = " ".join(target.read_text(encoding="utf-8").split())
        assert words.strip("“”") in said, f"{target.name} does not say {words}"
        assert row in known, f"no row is named {row}"


SPEED = re.compile(r"µs a step|times faster|some [\d ]+ a second")


def test_no_other_speed_is_claimed():
    """Beside the words that the page's list quotes, no page has any that claim a speed; claims.md quotes the README."""
    quoted = [cells[1].strip("“”") for cells in column(PAGE.read_text(encoding="utf-8"), "Said in")]
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        if page in (PAGE, ROOT / "docs" / "claims.md"):
            continue
        text = " ".join(page.read_text(encoding="utf-8").split())
        for words in quoted:
            text = text.replace(words, "")
        assert SPEED.findall(text) == [], page.name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("aoa_bands --seeds 1 --draws 4 --scenario base", "smoothed 19"),
        ("aoa_endless --rows 5000", " 0 without an angle"),
        ("aoa_hours --duration 70 --seeds 1", "then a polar"),
        ("imu_coverage --runs 2 --workers 1", "all together"),
        ("imu_coverage --runs 2 --workers 1 --method ferraris --by-scatter", "all together"),
        ("imu_coverage --runs 2 --workers 1 --method aided", "all together"),
        ("noise_coverage --runs 2 --workers 1", "weak K"),
        ("selfcal_coverage --runs 4 --workers 1", "runs/s"),
        ("selfcal_rig_coverage --runs 2 --workers 1", "largest error"),
        pytest.param(
            "strapdown_coverage --runs 2 --workers 1 --grade tactical", "| ok 2 |", marks=pytest.mark.campaign
        ),
        ("turntable_coverage --runs 2 --workers 1", "all together"),
    ],
)
def test_a_short_campaign(command, says, capsys, monkeypatch):
    script, *arguments = command.split()
    monkeypatch.setattr(sys, "argv", [script, *arguments])
    runpy.run_path(str(FOLDER / f"{script}.py"), run_name="__main__")
    assert says in capsys.readouterr().out


def test_a_short_campaign_of_faults(capsys, monkeypatch):
    """With one of the filters, and two of the faults."""
    campaign = importlib.import_module("selfcal_robustness")
    monkeypatch.setattr(campaign, "KINDS", ("error-state",))
    monkeypatch.setattr(campaign, "FAULTS", ("none", "stuck encoder"))
    monkeypatch.setattr(sys, "argv", ["selfcal_robustness", "--seeds", "1"])
    campaign.main()
    assert "stuck_encoder 1" in capsys.readouterr().out


@pytest.mark.campaign
def test_a_stress_campaign_goes_on_where_it_stopped(tmp_path, capsys, monkeypatch):
    """Kept in chunks, resumed, chunks with a broken law made again, in a table: as one undisturbed campaign."""
    stress = importlib.import_module("stress")
    monkeypatch.setattr(stress, "CHUNK", 4)
    monkeypatch.setattr(stress.faulthandler, "enable", lambda: None)  # pytest has its own

    def told(*words):
        """The exit code and what is said."""
        monkeypatch.setattr(sys, "argv", ["stress.py", *map(str, words), "--workers", "1"])
        with pytest.raises(SystemExit) as ended:
            stress.main()
        return ended.value.code, capsys.readouterr().out

    folders = [tmp_path / system for system in stress.ROOMS]
    for system, folder in zip(stress.ROOMS, folders, strict=True):
        runs = 20 if system == "drift" else 8
        stress.load(system)
        numbers = range(runs)
        whole, *_ = stress.campaign(numbers, [*map(stress.Absurd(system), numbers)])

        def state(folder=folder):
            found = json.loads((folder / "summary.json").read_text())
            return found["runs"], Counter(found["outcomes"]), found["wrong"]

        kept = ("--checkpoint", folder)
        assert told(system, "--runs", 4, *kept)[0] == 0
        first = folder / "runs-0-3.json"
        before = first.stat().st_mtime_ns
        assert told(system, "--runs", runs, *kept)[0] == 0
        assert first.stat().st_mtime_ns == before
        assert state() == (runs, whole, [])
        # a law that run 1 broke once
        answers = json.loads(first.read_text())
        answers[1][:2] = ["failed", ["broken"]]
        first.write_text(json.dumps(answers))
        assert told(system, "--runs", runs, *kept)[0] == 1
        assert state()[2] == [[1, "failed", "broken"]]
        assert told(system, "--runs", runs, *kept, "--again")[0] == 0
        assert state() == (runs, whole, [])
        monkeypatch.setattr(sys, "argv", ["stress.py", system, "--seed", "1", *map(str, kept)])
        with pytest.raises(InputError, match="is of another campaign"):
            stress.main()
    monkeypatch.setattr(sys, "argv", ["stress.py", "--table", *map(str, folders)])
    stress.main()
    assert "| runs | 8 | 20 | 8 |\n| runs that broke a law | 0 | 0 | 0 |" in capsys.readouterr().out


def test_a_run_without_end_is_ended_in_any_thread(monkeypatch):
    """As on a cluster, whose workers compute in a thread beside their main one; the next run goes on as ever."""
    runs = importlib.import_module("absurd.runs")
    expected = runs.one("drift", 3)
    with monkeypatch.context() as patch:
        patch.setattr(runs, "LONGEST", 0.1)
        patch.setattr("absurd.drift.run", lambda rng: [n for n in iter(int, 1) if n])
        with ThreadPoolExecutor(1) as pool:
            found = pool.submit(runs.one, "drift", 3).result()
    assert found.outcome == "failed"
    assert found.wrong[0].startswith("TooLongError: no end within 0.1 s")
    assert runs.one("drift", 3).outcome == expected.outcome


def test_a_run_that_keeps_its_end_for_itself_goes_on_all_the_same():
    """Code that catches any error may catch this one too: what comes after it is reached."""
    runs = importlib.import_module("absurd.runs")
    with runs.limited(0.05):
        try:
            while True:
                pass
        except Exception:  # as code that takes any error for an answer
            kept = True
    assert kept


def test_a_run_within_its_time_leaves_nothing_behind():
    """In a process whose lines are traced, as for coverage: it would go on with the same step for ever."""
    code = (
        "import sys\n"
        "from absurd.runs import limited\n"
        "sys.settrace(lambda *event: None)\n"
        "with limited(9.0):\n"
        "    pass\n"
        "def one():\n"
        "    return 1\n"
        "print(sum(one() for _ in range(9)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT / "benchmarks",
        capture_output=True,
        text=True,
        check=True,
        timeout=30.0,
    )
    assert done.stdout == "9\n"


def test_the_catalogue_of_faults_counts_what_ends_ok(tmp_path):
    """By hand: of four recordings shifted by more than 2 u one is unsaid, one said, one seen by no data."""
    import faults

    def made(draw, status, shift, told=False, blind=False, name="late"):
        row = {"system": "imu", "fault": name, "draw": draw, "status": status, "shift": shift}
        return row | {"of": "S_x", "named": [], "told": told, "blind": blind}

    rows = [
        made(0, "ok", 3.0),
        made(1, "ok", 3.0, told=True),
        made(2, "ok", 3.0, blind=True),
        made(3, "suspect", 3.0),
        made(4, "ok", 1.0),
        made(0, "ok", 0.0, name=""),
        made(1, "suspect", 0.0, name=""),
    ]
    found = faults.judged(rows)
    assert [found[key] for key in ("all", "harmed", "untold", "told", "blind")] == [5, 3, 1, 1, 1]
    assert [found[key] for key in ("sound", "not_ok")] == [2, 1]
    # none of n: 1 - 0.05^(1/n)
    assert faults.upper(0, 150) == pytest.approx(1.0 - 0.05 ** (1.0 / 150.0))
    path = tmp_path / "rows.jsonl"
    path.write_text("\n".join(json.dumps(each) for each in [*rows, rows[0]]) + '\n{"system": "im', "utf-8")
    assert faults.read(path) == rows
