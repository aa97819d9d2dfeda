"""The README and every page of the documentation run as written.

Studies, maps and recordings (TOML and CSV blocks) that begin with their file's name as a comment are laid into a
folder. There the Python blocks of the page run, and after them the console blocks line by line: a ``$`` line is run,
``[exit N]`` after it is the code expected (0 if none is shown), and every other line must begin a line of what is
printed on standard output or error, or hold the same words if it is a row of a table.
"""

import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import inercal.cli

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
#: pages whose commands take more than two seconds
SLOW = [
    "README.md",
    "docs/how-to/calibrate-an-imu.md",
    "docs/how-to/calibrate-on-a-turntable.md",
    "docs/how-to/measure-by-wire.md",
    "docs/how-to/noise.md",
    "docs/how-to/on-a-table-with-known-angles.md",
    "docs/how-to/read-your-files.md",
    "docs/how-to/rig-of-two-axes.md",
    "docs/how-to/several-records.md",
    "docs/how-to/temperature.md",
    "docs/how-to/tolerances-from-a-goal.md",
    "docs/how-to/use-a-cluster.md",
    "docs/published/continuous-self-calibration.md",
    "docs/published/zhao-2023.md",
    "docs/theory/angle-of-attack-fusion.md",
    "docs/theory/self-calibration-filters.md",
    "docs/tutorials/bench-to-certificate.md",
    "docs/tutorials/five-years.md",
    "docs/tutorials/strapdown.md",
    "docs/tutorials/turntable.md",
]
#: pages that take six seconds or more; what they run is in other tests too
LONG = [
    "docs/how-to/calibrate-a-platform.md",
    "docs/how-to/calibrate-a-strapdown-unit.md",
    "docs/how-to/design-a-path.md",
    "docs/how-to/live.md",
    "docs/how-to/measure-angle-of-attack.md",
    "docs/how-to/poses-or-turns.md",
    "docs/how-to/validate.md",
    "docs/tutorials/angle-of-attack.md",
    "docs/tutorials/self-calibration.md",
    "docs/tutorials/your-own-platform.md",
]
APART = ROOT / "docs" / "how-to" / "repeat-and-compare.md"
FENCE = re.compile(r"^```(python|console|toml|csv)\n(.*?)^```", re.DOTALL | re.MULTILINE)
EXIT = re.compile(r"\[exit (\d+)\]")


def blocks(page: Path, kind: str) -> list[str]:
    return [text for language, text in FENCE.findall(page.read_text(encoding="utf-8")) if language == kind]


def lay_out(page: Path, folder: Path) -> None:
    """Write the files of a page that say their name in the first line."""
    for text in [*blocks(page, "toml"), *blocks(page, "csv")]:
        if found := re.match(r"# ([\w-]+\.(?:toml|csv))\n", text):
            (folder / found[1]).write_text(text, encoding="utf-8")


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def run(words: list[str]) -> int:
    """Run a command of a page here: what it prints is captured, and no process has to load the program again."""
    assert words[0] == "inercal", f"only inercal is run on the pages, found {words[0]}"
    return inercal.cli.run(words[1:])


def run_apart(words: list[str]) -> int:
    """The same in a process of its own, as its reader does."""
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, timeout=120)
    print(done.stdout)
    print(done.stderr, file=sys.stderr)
    return done.returncode


def follow(
    page: Path, folder: Path, run: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    """Do in a folder, which is the working one, what a page says."""
    lay_out(page, folder)
    if code := "\n\n".join(blocks(page, "python")):
        exec(compile(code, name(page), "exec"), {"__name__": "__main__"})
    lines = [line for block in blocks(page, "console") for line in block.splitlines() if line.strip()]
    assert not lines or lines[0].startswith("$ ")
    while lines:
        command = lines.pop(0).removeprefix("$ ")
        expected = []
        while lines and not lines[0].startswith("$ "):
            expected.append(lines.pop(0))
        capsys.readouterr()
        code = run(shlex.split(command))
        found = "\n".join(capsys.readouterr())
        exits = [int(each[1]) for line in expected if (each := EXIT.fullmatch(line.strip()))]
        assert code == (exits[0] if exits else 0), f"{command}\n{found}"
        for line in expected:
            if not EXIT.fullmatch(line.strip()):
                assert shown(line, found), f"{command}\nexpected: {line}\nfound:\n{found}"


def shown(line: str, output: str) -> bool:
    """Whether a line of the page is in the output: a table row word by word, anything else as a beginning."""
    rows = output.splitlines()
    return any(row.strip().startswith(line.strip()) or row.split() == line.split() for row in rows)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working folder, and the width of a terminal for which the pages are written."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    return tmp_path


def marked(page: Path) -> object:
    return pytest.param(
        page, marks=[pytest.mark.slow] * (name(page) in SLOW) + [pytest.mark.campaign] * (name(page) in LONG)
    )


@pytest.mark.parametrize(
    "page",
    [marked(p) for p in PAGES if p != APART and (blocks(p, "python") or blocks(p, "console"))],
    ids=name,
)
@pytest.mark.usefixtures("undrawn")
def test_a_page_runs_and_prints_what_it_shows(page, folder, capsys):
    if page.name == "README.md":
        inercal.cli.run(["examples", "xsens", "--out", "demo", "--quiet"])
    follow(page, folder, run, capsys)


@pytest.mark.campaign
def test_a_page_runs_in_processes_of_their_own_too(folder, capsys):
    follow(APART, folder, run_apart, capsys)


def test_the_studies_and_maps_on_the_pages_are_such(tmp_path):
    import tomllib

    from new_studies import load_turntable_study

    from inercal.faces.studies.load import (
        load_aoa_study,
        load_imu_study,
        load_selfcal_study,
        load_strapdown_study,
    )
    from inercal.foundation.records.maps import read_map
    from inercal.laboratory.certificate.lab import read_lab
    from inercal.laboratory.specification import specification_of

    texts = [text for page in PAGES for text in blocks(page, "toml")]
    assert texts
    for text in texts:
        (tmp_path / "study.toml").write_text(text, encoding="utf-8")
        keys = tomllib.loads(text)
        if keys.keys() & {"columns", "file"}:
            read_map(tmp_path / "study.toml")
            continue
        if "persons" in keys:
            read_lab(tmp_path / "study.toml")
            continue
        if keys.keys() == {"specification"}:
            specification_of(keys["specification"], "study.toml")
            continue
        kind = keys.get("rig", {}).get("kind", "")
        special = {"": load_imu_study, "three_axis_gimbals": load_selfcal_study, "sting": load_aoa_study}
        load = load_strapdown_study if "strapdown" in keys else special.get(kind, load_turntable_study)
        load(tmp_path / "study.toml")


def test_every_link_between_pages_leads_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                assert (page.parent / target).exists(), f"{name(page)} links to {target}"
