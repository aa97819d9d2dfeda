"""The README and every page of the documentation run as written.

Studies, maps and recordings (TOML and CSV blocks) that begin with their file's name as a comment are laid into a
folder. There the Python blocks of the page run in one process, and after them the console blocks line by line: a
``$`` line is run, ``[exit N]`` after it is the code expected (0 if none is shown), and every other line must begin a
line of what is printed on standard output or error, or hold the same words if it is a row of a table.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(python|console|toml|csv)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(page: Path, kind: str) -> list[str]:
    return [text for language, text in FENCE.findall(page.read_text(encoding="utf-8")) if language == kind]


def lay_out(page: Path, folder: Path) -> None:
    """Write the files of a page that say their name in the first line."""
    for text in [*blocks(page, "toml"), *blocks(page, "csv")]:
        if found := re.match(r"# ([\w-]+\.(?:toml|csv))\n", text):
            (folder / found[1]).write_text(text, encoding="utf-8")


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def run_python(page: Path, folder: Path) -> None:
    """Run the Python blocks of a page, if it has any."""
    if code := "\n\n".join(blocks(page, "python")):
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "page", [p for p in PAGES if blocks(p, "python") and not blocks(p, "console")], ids=name
)
def test_python_runs(page, tmp_path):
    lay_out(page, tmp_path)
    run_python(page, tmp_path)


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    words = shlex.split(command)
    assert words[0] == "inercal", f"only inercal is run on the pages, found {words[0]}"
    environment = os.environ | {"COLUMNS": "120"}
    return subprocess.run(
        [sys.executable, "-m", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        env=environment,
        timeout=120,
    )


def shown(line: str, output: str) -> bool:
    """Whether a line of the page is in the output: a table row word by word, anything else as a beginning."""
    rows = output.splitlines()
    return any(row.strip().startswith(line.strip()) or row.split() == line.split() for row in rows)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "console")], ids=name)
def test_commands_run_and_print_what_the_page_shows(page, tmp_path):
    lines = [line for block in blocks(page, "console") for line in block.splitlines() if line.strip()]
    assert lines[0].startswith("$ ")
    lay_out(page, tmp_path)
    run_python(page, tmp_path)
    while lines:
        command = lines.pop(0).removeprefix("$ ")
        expected = []
        while lines and not lines[0].startswith("$ "):
            expected.append(lines.pop(0))
        done = run(command, tmp_path)
        codes = [
            int(found[1]) for line in expected if (found := re.fullmatch(r"\[exit (\d+)\]", line.strip()))
        ]
        assert done.returncode == (codes[0] if codes else 0), f"{command}\n{done.stderr}"
        for line in expected:
            if not re.fullmatch(r"\[exit \d+\]", line.strip()):
                found = f"{done.stdout}\n{done.stderr}"
                assert shown(line, found), f"{command}\nexpected: {line}\nfound:\n{found}"


def test_the_studies_and_maps_on_the_pages_are_such(tmp_path):
    import tomllib

    from inercal.records.maps import read_map
    from inercal.study.load import (
        load_aoa_study,
        load_imu_study,
        load_selfcal_study,
        load_turntable_study,
    )

    texts = [text for page in PAGES for text in blocks(page, "toml")]
    assert texts
    for text in texts:
        (tmp_path / "study.toml").write_text(text, encoding="utf-8")
        keys = tomllib.loads(text)
        if keys.keys() & {"columns", "file"}:
            read_map(tmp_path / "study.toml")
            continue
        kind = keys.get("rig", {}).get("kind", "")
        special = {"": load_imu_study, "three_axis_gimbals": load_selfcal_study, "sting": load_aoa_study}
        special.get(kind, load_turntable_study)(tmp_path / "study.toml")


def test_every_link_between_pages_leads_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                assert (page.parent / target).exists(), f"{name(page)} links to {target}"
