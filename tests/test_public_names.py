"""What the package shows: its public names, sorted, each resolved only when asked for."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import inercal


def test_the_public_names_are_sorted_and_all_resolve():
    assert inercal.__all__ == sorted(inercal.__all__)
    assert set(dir(inercal)) == {*inercal.__all__, "__version__"}
    for name in inercal.__all__:
        assert getattr(inercal, name).__doc__


def test_types_are_told_of_the_same_names_from_the_same_modules():
    body = ast.parse(Path(inercal.__file__).read_text("utf-8")).body
    (block,) = (each for each in body if isinstance(each, ast.If))
    told = {alias.asname: each.module for each in block.body for alias in each.names}
    assert told == inercal._WHERE


def test_what_is_not_public_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'numpy'"):
        _ = inercal.numpy


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, inercal\n"
        "found = {'numpy', 'numba', 'scipy', 'pydantic', 'cyclopts', 'matplotlib'} & set(sys.modules)\n"
        "assert not found, found"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_the_version_is_that_of_the_project_file(request):
    text = (request.config.rootpath / "pyproject.toml").read_text("utf-8")
    assert re.search(r'^version = "(.+)"$', text, re.MULTILINE)[1] == inercal.__version__
    citation = (request.config.rootpath / "CITATION.cff").read_text("utf-8")
    assert f"version: {inercal.__version__}" in citation
