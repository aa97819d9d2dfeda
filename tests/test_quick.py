"""What `make quick` runs follows from what changed, through the imports."""

import pytest

import quick

pytestmark = pytest.mark.slow  # the first reads all imports


def order(*files):
    return quick.selected(list(files))


@pytest.fixture(scope="module", autouse=True)
def _every_import_read():
    """Seconds that no single test is to pay."""
    order("src/inercal/foundation/units.py")


def test_the_nearest_tests_come_first_and_the_house_before_them():
    found = order("src/inercal/systems/aoa/paper/static.py")
    assert found[:3] == ["tests/test_architecture.py", "tests/laws", "tests/aoa/test_aoa_static.py"]
    # aoa's own, before those that run commands
    assert found.index("tests/aoa/test_aoa_lever.py") < found.index("tests/cli/test_simulate_aoa.py")
    # another system does not hear of it but through the commands
    assert "tests/selfcal/test_batch.py" not in found


def test_a_helper_of_the_tests_asks_for_those_that_use_it():
    assert "tests/selfcal/test_batch.py" in order("tests/studies/paper_study.py")
    assert "tests/noise/test_noise_coverage.py" in order("benchmarks/campaigns/noise.py")


def test_a_page_asks_for_its_own_test():
    page = "docs/how-to/repeat-and-compare.md"
    name = f"tests/docs/test_pages.py::test_a_page_runs_and_prints_what_it_shows[{page}]"
    assert name not in order(page)  # it runs apart
    assert name.replace(page, "README.md") in order("README.md")
    assert "tests/docs/test_claims.py" in order("README.md")


@pytest.mark.parametrize("file", ["LICENSE", "tests/test_gone.py", "docs/gone.md"])
def test_what_nothing_imports_asks_for_no_more_than_the_house(file):
    assert order(file) == list(quick.ALWAYS)


def test_data_of_a_package_are_of_the_package():
    assert "tests/report/test_html.py" in order("src/inercal/faces/report/page.html")


def test_however_much_is_asked_for_only_the_nearest_files_are_read():
    found = order("src/inercal/foundation/units.py")
    assert len(found) == len(quick.ALWAYS) + quick.FILES
    assert "tests/test_units.py" in found[:10]


def test_imports_in_functions_and_in_the_tree_of_commands_count():
    import ast

    modules = {"inercal.a": None, "inercal.b": None, "inercal.b.c": None}
    tree = ast.parse("def f():\n    from inercal.b import c\nx = {'new': 'inercal.a:new'}\nimport numpy")
    assert quick.imported(tree, modules) == {"inercal.a", "inercal.b.c"}


def test_distances_are_those_of_the_shortest_way():
    uses = {"a": set(), "b": {"a"}, "c": {"b"}, "d": {"a", "c"}, "e": set()}
    assert quick.distances({"a"}, uses) == {"a": 0, "b": 1, "d": 1, "c": 2}
