"""One tool by one mind: options, words, results and reports of all commands follow the same laws."""

import json
import re
import shutil
import subprocess
import tomllib
from functools import partial
from itertools import pairwise

import pytest
from new_studies import FILL, filled, load_turntable_study

from inercal.cli import run
from inercal.cli.package import script
from inercal.cli.tree import COMMANDS
from inercal.examples import EXAMPLES
from inercal.faces.studies.load import (
    load_aoa_study,
    load_imu_study,
    load_selfcal_study,
    load_strapdown_study,
)
from inercal.foundation.instruments.terms import term

pytestmark = pytest.mark.usefixtures("undrawn")

BAD_VERDICT = 1
OPTION = re.compile(r"^ {2}(--[\w-]+)(?: (PATH|STR\.\.\.|STR|INT|CHOICE))?: (.*)$", re.MULTILINE)
READ_A_RECORD = {
    *("inspect", "calibrate imu", "calibrate strapdown", "calibrate turntable", "selfcal", "aoa"),
    *("allan", "temperature", "apply", "monitor", "live", "batch"),
}
READ_A_STUDY = {
    *(
        "calibrate imu",
        "calibrate strapdown",
        "calibrate turntable",
        "selfcal",
        "aoa",
        "sensitivity",
        "design positions",
        "batch",
        "live",
    ),
    *("design tolerances", "design selfcal", "design strapdown", "design aoa", "design sections"),
    *("simulate imu", "simulate strapdown", "simulate turntable", "simulate selfcal", "simulate aoa"),
}
WITHOUT_A_FILE = {"monitor", "live", "keep", "instruments", "results", "supersede", "rerun", "workbench"} | {
    f"store {kind}" for kind in ("init", "upgrade", "check", "scrub", "export", "import")
}
TEMPLATES = {
    "imu": (partial(filled, "imu"), load_imu_study),
    "strapdown": (partial(filled, "strapdown"), load_strapdown_study),
    "turntable": (partial(filled, "turntable"), load_turntable_study),
    "selfcal": (partial(filled, "selfcal"), load_selfcal_study),
    "aoa": (partial(filled, "aoa"), load_aoa_study),
}


@pytest.fixture(scope="module")
def helps():
    """The help of every command, in lines that are not broken."""
    import contextlib
    import io

    texts = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "500")
        for command in COMMANDS:
            words = [word for word in command if word]
            with contextlib.redirect_stdout(io.StringIO()) as out:
                assert run([*words, "--help"]) == 0
            texts[" ".join(words)] = out.getvalue()
    return texts


def options(text):
    """The options of a help: name -> (kind of value, words)."""
    return {name: (value, words) for name, value, words in OPTION.findall(text)}


def test_an_option_has_one_kind_of_value_and_one_text_in_all_commands(helps):
    """Whoever knows one command knows the options of the others; --compare, --filter and --stream say what each has.

    --runs is a number of simulated runs, and of `aoa` the table that lists them; `keep` is given a --report; --out of
    `batch` is a folder; --to is a tool for `convert`, and a sink of `live`."""
    own = {"--compare", "--filter", "--stream", "--runs", "--report", "--out", "--to"}
    meanings = {}
    for command, text in helps.items():
        for name, (value, words) in options(text).items():
            meanings.setdefault(name, {}).setdefault((value, words.replace(" [required]", "")), []).append(
                command
            )
    assert len(meanings) > 20
    for name, found in meanings.items():
        assert len({value for value, _ in found}) == (2 if name in {"--runs", "--to"} else 1), name
        assert len(found) == 1 or name in own, (name, found)


def test_common_options_are_where_they_apply(helps):
    """--json and --quiet everywhere, --out but on a stream, --map where a record is read, --set where a study is."""
    for command, text in helps.items():
        given = set(options(text))
        assert {"--json", "--quiet"} <= given, command
        assert ("--out" in given) == (command not in WITHOUT_A_FILE), command
        assert ("--map" in given) == (command in READ_A_RECORD), command
        assert ("--set" in given) == (command in READ_A_STUDY or command.startswith("new ")), command
    assert set(helps) >= READ_A_RECORD | READ_A_STUDY | WITHOUT_A_FILE


def test_a_help_is_broken_once_at_the_width_of_the_terminal(capsys, monkeypatch):
    """What does not fit goes on further in, and the words are those of the line that is not broken."""
    told = {}
    for width in (80, 500):
        monkeypatch.setenv("COLUMNS", str(width))
        told[width] = []
        for words in ([], ["aoa"], ["validate"]):
            assert run([*words, "--help"]) == 0
            told[width].append(capsys.readouterr().out)
    for narrow, wide in zip(told[80], told[500], strict=True):
        assert narrow.split() == wide.split()
        lines = re.search(r"^(Commands|Parameters):\n(.*?)\n\n", narrow, re.DOTALL | re.MULTILINE)[2].split(
            "\n"
        )
        assert all(re.match(r"  \S|    \S", line) and len(line) <= 80 for line in lines)
        for line, after in pairwise(lines):
            if after.startswith("    "):
                assert len(line) + 1 + len(after.split()[0]) > 80, line


def test_every_help_has_one_shape(helps):
    """Usage, one sentence, arguments, parameters in one order, an example of the very command."""
    last = ["--json", "--quiet", "--out", "--report"]
    for command, text in helps.items():
        used, *_ = text.splitlines()
        assert used.startswith(f"Usage: inercal {command} ")
        arguments = re.findall(r"^ {2}([A-Z]+): (.*)$", text, re.MULTILINE)
        named = [name if words.endswith("[required]") else f"[{name}]" for name, words in arguments]
        needs = "--study" in options(text) and command not in ("live", "calibrate imu")  # may do without
        needed = ["--study", "PATH"] if needs else []
        needed = ["--reason", "STR"] if "--reason" in options(text) else needed
        assert used.split()[2 + len(command.split()) :] == [*named, *needed, "[OPTIONS]"]
        names = list(options(text))
        assert names[-len(last) :] == last or [n for n in names if n in last] == [
            n for n in last if n in names
        ]
        assert all(words.endswith((".", "]")) for _, words in options(text).values()), command
        assert text.rstrip().splitlines()[-1].startswith(f"Example: inercal {command}")


@pytest.mark.parametrize("kind", TEMPLATES)
def test_every_template_is_a_study_that_its_command_reads(kind, tmp_path):
    """Untouched, and under the JSON Schema that editors check by."""
    from jsonschema import Draft202012Validator

    from inercal.faces.studies.schema import json_schema

    template, load = TEMPLATES[kind]
    path = tmp_path / f"{kind}.toml"
    path.write_text(template(), encoding="utf-8")
    load(path)
    Draft202012Validator(json_schema()).validate(tomllib.loads(template()))


def test_a_key_of_several_templates_has_one_form():
    """[site] of all four kinds reads alike, and so do [traceability] and what else they share."""
    sites = {kind: tomllib.loads(template()).get("site", {}) for kind, (template, _) in TEMPLATES.items()}
    keys = {kind: list(site) for kind, site in sites.items()}
    assert len({tuple(names) for names in keys.values()}) == 1, keys


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """JSON and report of every command that can write a report, on what ships with the package."""
    folder = tmp_path_factory.mktemp("all")
    for name in ("xsens", "strapdown", "sting", "selfcal", "thermal", "lasergyro"):
        assert run(["examples", name, "--out", str(folder / name), "--quiet", "--json"]) == 0
    at = {name: EXAMPLES[name].command(str(folder / name)).split()[1:] for name in EXAMPLES}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for kind in ("turntable", "selfcal"):
            assert run(["new", kind, "--quiet", *FILL]) == 0
        small = ["--set", "positions.grid={phi1=6, phi2=6}"]
        assert run(["simulate", "turntable", "turntable.toml", *small, "--out", "tt.csv", "--quiet"]) == 0
        commands = {
            "calibrate imu": at["xsens"],
            "calibrate strapdown": at["strapdown"],
            "inspect": ["inspect", str(folder / "sting/sting.csv.gz")],
            "selfcal": at["selfcal"],
            "aoa": at["sting"],
            "temperature": at["thermal"],
            "allan": [*at["lasergyro"], "--end", "60 s"],
            "calibrate turntable": ["calibrate", "turntable", "tt.csv", "--study", "turntable.toml"],
            "sensitivity": ["sensitivity", "turntable.toml", *small],
            "design positions": ["design", "positions", "turntable.toml", *small],
            "compare": ["compare", "calibrate-imu.json", "calibrate-imu.json"],
        }
        found = {}
        for command, words in commands.items():
            name = command.replace(" ", "-")
            files = ["--out", f"{name}.json", "--report", f"{name}.html"]
            assert run([*words, *files, "--quiet"]) in (0, BAD_VERDICT), command
            found[command] = (
                json.loads((folder / f"{name}.json").read_text("utf-8")),
                (folder / f"{name}.html").read_text("utf-8"),
            )
    return found


@pytest.mark.slow
def test_every_result_has_the_same_keys_in_the_same_order(results):
    """One type of result, by one road: what a command has not is empty, not absent."""
    assert len({tuple(data) for data, _ in results.values()}) == 1
    for command, (data, _) in results.items():
        assert data["command"] == command
        assert {"code", "message"} == set(data["status"])
        assert data["timing_s"]["total"] > 0.0
        assert [p["name"] for p in data["parameters"]] == data["covariance"]["names"]
        assert all(len(source["sha256"]) == 64 for source in data["inputs"])
        assert data["inputs"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    ["calibrate turntable", *(pytest.param(each, marks=pytest.mark.campaign) for each in ("selfcal", "aoa"))],
)
def test_the_temperature_of_a_result_is_that_stated_or_else_that_recorded(tmp_path, monkeypatch, command):
    """An example, or a simulated test, with a column of 21.5 and 22.5 degC by turns."""
    monkeypatch.chdir(tmp_path)
    name = command.split()[-1]
    assert run(["new", name, "--quiet", *FILL]) == 0
    small = ["--set", "positions.grid={phi1=6, phi2=6}"] if name == "turntable" else []
    assert run(["simulate", name, f"{name}.toml", *small, "--seed", "1", "--out", "made.csv", "--quiet"]) == 0
    head, *rows = (tmp_path / "made.csv").read_text("utf-8").splitlines()
    warm = [
        f"{head},temperature [degC]",
        *(f"{row},{21.5 + k % 2}" for k, row in enumerate(rows[: len(rows) & ~1])),
    ]
    (tmp_path / "warm.csv").write_text("\n".join(warm) + "\n", "utf-8")
    words = [*command.split(), "warm.csv", "--study", f"{name}.toml", "--quiet"]
    recorded, stated = (22.0, 0.5), (20.0, 0.0)
    for more, expected in (([], recorded), (["--set", "conditions.temperature=20 degC"], stated)):
        assert run([*words, *more, "--out", "found.json"]) in (0, BAD_VERDICT)
        found = json.loads((tmp_path / "found.json").read_text("utf-8"))["conditions"]["temperature"]
        assert found == {"value": expected[0], "u": expected[1], "unit": "degC"}


@pytest.mark.slow
def test_every_name_in_a_result_has_a_row_in_the_table_of_terms(results):
    """And the unit of that row, whatever that of the output is."""
    names = {p["name"]: p["unit"] for data, _ in results.values() for p in data["parameters"]}
    assert len(names) > 80
    for name, unit in names.items():
        row = term(name)
        assert row is not None, name
        assert row.name
        fixed = not row.unit.startswith("output") and "output" not in row.unit
        if fixed and not name.startswith(("k_", "D")):  # those of a drift are per output of the gyrowheel
            assert unit == row.unit, name


def test_a_name_that_no_command_gives_has_no_row():
    assert [term(name) for name in ("K9_x", "b_", "N_", "gyro_w", "K0_x_T9", "dr_x")] == [None] * 6


@pytest.mark.slow
def test_every_result_of_a_method_says_what_it_rests_on(results):
    """Also that of a command that estimates nothing; a look at a file has no method."""
    assert [command for command, (data, _) in results.items() if not data["references"]] == ["inspect"]
    for data, page in results.values():
        assert (">References</h" in page) == bool(data["references"])


@pytest.mark.slow
@pytest.mark.parametrize("section", ["Findings", "How it was done", "Command and settings", "Inputs"])
def test_every_report_has_the_sections_that_all_have(section, results):
    for command, (_, page) in results.items():
        assert f">{section}</h" in page, command


@pytest.mark.slow
def test_every_report_has_one_frame(results):
    """Title, verdict, one picture, findings first; how it was done last; one style sheet; no script."""
    styles = set()
    for command, (data, page) in results.items():
        heads = re.findall(r"<h2>(.*?)</h2>", page)
        assert heads[1] == "Findings", command
        assert page[: page.index("<h2>Findings</h2>")].count("<figure") == 1, command
        assert heads[-1] == "How it was done", command
        code = data["status"]["code"].replace("_", " ")
        assert page.index("<h1>") < page.index(f'<span class="code">{code}</span>') < page.index("<h2>")
        assert f'<dd class="mono">{command}</dd>' in page
        assert page.count("<h1>") == 1
        assert "<script" not in page
        styles.add(page[page.index("<style>") : page.index("</style>")])
    assert len(styles) == 1


@pytest.mark.slow
def test_what_was_asked_for_comes_before_the_sensors(results):
    """Whoever measures an angle finds the angle ahead of the coefficients."""
    page = results["aoa"][1]
    assert page.index("<h2>Angle</h2>") < page.index("<h2>Coefficients</h2>")


@pytest.mark.slow
def test_a_report_says_nothing_twice(results):
    """A title stands once, and so does the row of a coefficient: under one heading only."""
    for command, (_, page) in results.items():
        told = re.sub(r"<figure>.*?</figure>", "", page, flags=re.DOTALL)
        heads = [head.lower() for head in re.findall(r"<h[23]>(.*?)</h[23]>", told)]
        assert len(set(heads)) == len(heads) > 3, command
    page, names = results["aoa"][1], [each["name"] for each in results["aoa"][0]["parameters"]]
    values = page.partition("<h2>Coefficients</h2>")[2].partition("<h2>Uncertainty budget</h2>")[0]
    assert names
    for name in names:
        assert len(re.findall(rf"<td[^>]*>(?:<b>)?{name}\b", values)) == 1, name


@pytest.mark.slow
def test_a_report_has_no_radians(results):
    """Angles of place and range are in degrees for people; only coefficients that are small angles are in rad."""
    for command, (_, page) in results.items():
        told = page[page.find("<h2>Model") :] if "<h2>Model" in page else ""
        told = told[: told.find("</section>")]
        assert not re.search(r"<dd>[^<]* rad(?:/s)?</dd>", told), command


@pytest.mark.parametrize("command", [["--seed", "1.5"], ["--runs", "2.5"], ["--seed", "many"]])
def test_a_whole_number_is_one(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["simulate", "selfcal", "s.toml", *command, "--out", "a.csv"]) == 2
    assert capsys.readouterr().err == (
        f"inercal: error: {command[0]}: found '{command[1]}', expected a whole number\n"
    )


def test_a_kind_of_motion_that_is_set_takes_the_place_of_the_other(tmp_path):
    """The keys of the old kind go; those that the new one needs are still asked for."""
    path = tmp_path / "aoa.toml"
    path.write_text(filled("aoa"), encoding="utf-8")
    swept = ["motion.first=0 deg", "motion.kind=static", "motion.last=10 deg"]
    assert load_aoa_study(path, swept).motion.kind == "static"


def test_a_missing_unit_gets_an_example_of_its_own_key(tmp_path):
    from inercal.foundation.errors import StudyError

    path = tmp_path / "selfcal.toml"
    path.write_text(filled("selfcal"), encoding="utf-8")
    with pytest.raises(StudyError, match=r"noise\.accelerometer: .*without a unit") as caught:
        load_selfcal_study(path, ["noise.accelerometer=10"])
    assert "9.81" not in str(caught.value)


COMPLETE = """
source {script}
COMP_WORDS=({words}); COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 ))
_inercal; printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture(scope="module")
def scripts():
    return {shell: script(shell) for shell in ("bash", "zsh", "fish")}


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash to complete in")
def test_bash_completes_verbs_kinds_options_and_choices(tmp_path, scripts):
    """Asked as readline asks; where nothing is offered, readline completes file names itself."""
    path = tmp_path / "inercal.bash"
    path.write_text(scripts["bash"], encoding="utf-8")
    asked = {
        "inercal cal": {"calibrate"},
        "inercal simulate ''": {"imu", "strapdown", "turntable", "selfcal", "aoa"},
        "inercal aoa --sta": {"--static", "--states"},
        "inercal selfcal --filter ''": {"error-state", "svd-qukf", "gimbal-ukf", "map"},
        "inercal aoa log.csv --states ''": {"8", "11", "15", "19"},
        "inercal calibrate imu --study ''": {""},
    }
    text = "".join(f"({COMPLETE.format(script=path, words=words)}); echo ==\n" for words in asked)
    done = subprocess.run(
        ["bash", "--norc", "-c", text], capture_output=True, text=True, timeout=60, check=True
    )
    found = [set(part.splitlines()) or {""} for part in done.stdout.split("==\n")[:-1]]
    assert found == list(asked.values())
    assert "complete -o default -F _inercal inercal" in path.read_text("utf-8")


def test_the_scripts_know_every_command(capsys, scripts):
    for text in scripts.values():
        assert all(word in text for command in COMMANDS for word in command if word)
    assert run(["completion", "zsh", "--json", "--quiet"]) == 0
    assert json.loads(capsys.readouterr().out)["result"] == {"shell": "zsh", "text": scripts["zsh"]}
