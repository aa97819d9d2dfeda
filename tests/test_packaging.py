"""The wheel and the source archive are whole: built, installed and tried outside the tree."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import inercal
from inercal.foundation._jit import way

ROOT = Path(__file__).parents[1]
PACKAGE = Path(inercal.__file__).parent


def run(*command: object, cwd: Path, **environment: str) -> str:
    """Run a program that must end well; what it printed."""
    done = subprocess.run(
        [*map(str, command)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": ""} | environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> tuple[Path, Path]:
    """The source archive of this tree, and the wheel that is built from that archive alone."""
    folder = tmp_path_factory.mktemp("built")
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", folder, cwd=ROOT)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as whole:
        whole.extractall(folder, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))
    unpacked = folder / archive.name.removesuffix(".tar.gz")
    if way().how == "compiled":  # not once more
        shutil.copytree(ROOT / "build" / "kernels", unpacked / "build" / "kernels")
    how = "" if way().how == "compiled" else "python"
    wheel = (sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder)
    run(*wheel, cwd=unpacked, INERCAL_KERNELS=how)
    (wheel,) = folder.glob("*.whl")
    return archive, wheel


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory) -> Path:
    """A folder into which the wheel was installed, without what it needs (that is in this environment)."""
    folder = tmp_path_factory.mktemp("installed")
    flags = ["--quiet", "--no-deps", "--no-index", "--disable-pip-version-check", "--target", folder]
    run(sys.executable, "-m", "pip", "install", *flags, built[1], cwd=folder)
    return folder


def sources(folder: Path) -> dict[str, bytes]:
    """Everything that belongs to the package, by its path in it."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_the_wheel_holds_the_package_and_nothing_else(built):
    with zipfile.ZipFile(built[1]) as wheel:
        names = [name for name in wheel.namelist() if ".dist-info/" not in name]
        found = {name.removeprefix("inercal/"): wheel.read(name) for name in names}
    assert all(name.startswith("inercal/") for name in names)
    assert found == sources(PACKAGE)


def test_the_source_archive_is_enough_to_test_and_document(built):
    with tarfile.open(built[0]) as whole:
        names = {name.partition("/")[2] for name in whole.getnames()}
    tracked = {"README.md", "Makefile", "pyproject.toml", "requirements/dev.txt", "CHANGES.md", "LICENSE"}
    folders = ("src", "kernels", "tests", "docs", "benchmarks")
    wanted = {
        path.relative_to(ROOT).as_posix()
        for folder in folders
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".md", ".toml", ".svg", ".csv") and "__pycache__" not in path.parts
    }
    assert tracked | wanted <= names
    assert not [name for name in names if name.startswith(("build/", ".venv", "dist/")) or ".pyc" in name]


def test_the_metadata_say_what_a_user_of_an_index_asks(built):
    with zipfile.ZipFile(built[1]) as wheel:
        (name,) = [name for name in wheel.namelist() if name.endswith("METADATA")]
        text = wheel.read(name).decode()
    for line in (
        f"Version: {inercal.__version__}",
        "Requires-Python: >=3.11",
        "License-Expression: Apache-2.0",
    ):
        assert line in text
    assert "Requires-Dist: numpy>=" in text
    assert all("extra == 'jit'" in line for line in text.splitlines() if "Requires-Dist: numba" in line)
    assert "# inercal" in text, "the README is the page of the project"


@pytest.mark.slow
def test_the_installed_package_calibrates_outside_the_tree(installed, tmp_path):
    def inercal_says(*arguments: object) -> str:
        return run(
            sys.executable, installed / "bin" / "inercal", *arguments, cwd=tmp_path, PYTHONPATH=str(installed)
        )

    where = run(
        sys.executable,
        "-c",
        "import inercal; print(inercal.__file__)",
        cwd=tmp_path,
        PYTHONPATH=str(installed),
    )
    assert Path(where.strip()).is_relative_to(installed)
    assert inercal_says("--version").strip() == inercal.__version__
    inercal_says("examples", "xsens", "--out", "xsens", "--quiet")
    files = ["xsens/xsens_acc.mat", "xsens/xsens_gyro.mat", "--map", "xsens/xsens-map.toml"]
    done = inercal_says(
        "calibrate",
        "imu",
        *files,
        "--study",
        "xsens/xsens.toml",
        "--report",
        "report.html",
        "--json",
        "--quiet",
    )
    assert json.loads(done)["status"]["code"] == "ok"
    assert "</html>" in (tmp_path / "report.html").read_text(encoding="utf-8")
