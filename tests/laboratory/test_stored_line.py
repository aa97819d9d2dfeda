"""A stored command line, which anybody may have written: only what reads kept files and computes is run again."""

import hashlib
import json
import os
import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import pytest

from inercal.cli import run
from inercal.cli.stored_line import COMMANDS_AGAIN, OPTIONS_AGAIN, Use, stored_line
from inercal.cli.tree import COMMANDS, app
from inercal.examples import EXAMPLES, FOLDER
from inercal.foundation.errors import InputError
from inercal.laboratory.again import LaidOut, laid_out
from inercal.laboratory.objects import Objects
from rows import for_each

REFUSED = {
    "new imu", "new strapdown", "new turntable", "new selfcal", "new aoa", "new lab", "inspect", "apply", "convert",
    "monitor", "certificate", "simulate turntable", "simulate imu", "simulate strapdown", "simulate aoa", "schema",
    "completion", "examples", "keep", "instruments", "results", "show", "supersede", "rerun", "batch", "live",
    "workbench", *(f"store {kind}" for kind in ("init", "upgrade", "check", "scrub", "export", "import")),
}  # fmt: skip
"""Commands that write, send, fetch or connect, or make no result that a store can run again."""


def options_of(verb, kind):
    root = app()
    command = root[verb][kind] if kind else root[verb]
    return [each for each in command.assemble_argument_collection() if each.parse and each.name != "*"]


def test_somebody_has_judged_every_command():
    """A new command stands in one of the two lists, and is refused until somebody puts it into that of the program."""
    names = {" ".join(filter(None, each)) for each in COMMANDS}
    assert names == REFUSED | COMMANDS_AGAIN.keys()
    assert not REFUSED & COMMANDS_AGAIN.keys()


@pytest.mark.parametrize("command", COMMANDS_AGAIN)
def test_somebody_has_judged_every_option(command):
    """A new option stands in the list with its use, and is refused until then; a path is never a mere value."""
    verb, _, kind = command.partition(" ")
    for option in options_of(verb, kind):
        use = OPTIONS_AGAIN.get(f"{command} {option.name}") or OPTIONS_AGAIN.get(option.name)
        assert use in get_args(Use), f"{command} {option.name} is in no list"
        assert use != "value" or "Path" not in str(option.hint)
        assert use != "file" or "Path" in str(option.hint) or option.name == "OF"


def test_no_option_is_listed_that_is_none():
    there = set()
    for command in COMMANDS_AGAIN:
        verb, _, kind = command.partition(" ")
        there |= {name for each in options_of(verb, kind) for name in (each.name, f"{command} {each.name}")}
    assert OPTIONS_AGAIN.keys() <= there


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "certificate cal.json --lab lab.toml --number 7 --html /etc/motd --out x.xml",
            "found 'certificate'",
        ),
        ("batch fleet.csv --study imu.toml --out f --cluster tcp://evil:8786", "found 'batch'"),
        ("store export /tmp/copy", "found 'store export'"),
        ("store init --store /tmp/new", "found 'store init'"),
        ("keep cal.json --store /tmp/other", "found 'keep'"),
        ("live udp://evil:1 --study s.toml", "found 'live'"),
        ("workbench --host 0.0.0.0", "found 'workbench'"),
        ("apply cal.json log.csv --out x.csv", "found 'apply'"),
        ("rerun 1234", "found 'rerun'"),
        ("calibrate", "found 'calibrate'"),
        ("--version", "found '--version'"),
        ("no-such-verb x", "found 'no-such-verb'"),
        ("selfcal --help", "found 'selfcal --help'"),
        ("selfcal x.csv --study s.toml -h", "found a question for help"),
        ("selfcal --study s.toml --stream", "found --stream, expected options that only"),
        ("selfcal --study s.toml --stream=true", "found --stream, expected options that only"),
        ("aoa x.csv --study s.toml --every 1s", "found --every"),
        ("selfcal x.csv --study s.toml --checkpoint_every 7", "found --checkpoint-every"),
        ("selfcal x.csv --study s.toml --after 1s", "found --after"),
        ("selfcal x.csv --study s.toml --no-stream", "the option --no-stream"),
        ("selfcal x.csv --study s.toml --OUT y", "the option --OUT"),
        ("selfcal x.csv --study s.toml -o y", "the option -o"),
        ("selfcal x.csv --study s.toml --output.out y", "the option --output.out"),
        ("selfcal x.csv --study --out=y", "found nothing after --study"),
        ("selfcal x.csv", "--study is missing"),
    ],
)
def test_what_writes_sends_fetches_or_cannot_be_read_is_refused(line, expected):
    with pytest.raises(InputError) as refused:
        stored_line(shlex.split(line))
    assert str(refused.value).startswith("its command line: ")
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "line", [{"a": 1}, "selfcal x", 7, None, [7], [["validate"]], [], ["validate", "\0"], ["\ud800"]]
)
def test_what_is_no_list_of_words_is_refused(line):
    with pytest.raises(InputError, match="its command line"):
        stored_line(line)


@pytest.fixture
def laid(tmp_path):
    """Files as they are laid out: a recording and a study beside the command, a map that had an absolute path."""
    folder, absolute = tmp_path / "root" / "d", tmp_path / "absolute" / "lab"
    for place in (folder / "sub", absolute):
        place.mkdir(parents=True)
    example = EXAMPLES["sting"]
    (folder / "log.csv").write_text("t [s],acc_x [m/s^2]\n0,1\n1,2\n")
    (folder / "sub" / "study.toml").write_bytes((FOLDER / example.study).read_bytes())
    (absolute / "map.toml").write_text("[columns.acc_x]\nfrom = 'a'\nunit = 'm/s^2'\n")
    (tmp_path / "root" / "up.csv").write_text("t [s],acc_x [m/s^2]\n0,1\n1,2\n")
    here = {each: each for each in ("log.csv", "sub/study.toml", "../up.csv", "gone.csv")}
    there = {"/lab/map.toml": str(absolute / "map.toml")}
    return LaidOut(Path(os.path.realpath(tmp_path)), folder, {**here, **there})


def test_a_sound_line_is_written_anew_on_the_files_that_were_kept(laid):
    line = (
        "aoa ../up.csv ./log.csv --study sub//study.toml --map=/lab/map.toml --states 15 --smooth --begin -3 "
        "--set estimator.low_pass=auto --set=site.latitude=48 --out result.NC --report=../r.html --keep --json"
    )
    words = stored_line(shlex.split(line)).words(laid)
    assert words == (
        "aoa", "--study=./sub/study.toml", "--states=15", "--smooth", f"--map={laid.places['/lab/map.toml']}",
        "--begin=-3", "--set=estimator.low_pass=auto", "--set=site.latitude=48", f"--out={laid.root}/out.NC",
        f"--report={laid.root}/report.html", "--json", "--quiet", "--", "./../up.csv", "./log.csv",
    )  # fmt: skip


@pytest.mark.parametrize(
    "line",
    [
        "validate --keep --store postgresql://evil/x --instrument A --quiet --json",
        "validate --store=/elsewhere --keep",
        "simulate selfcal sub/study.toml --runs 4 --checkpoint /elsewhere --cluster tcp://evil:8786",
        "simulate selfcal sub/study.toml --runs 4 --cluster=tcp://evil:8786 --checkpoint=/elsewhere",
    ],
)
def test_what_changes_no_result_is_left_out(line, laid):
    study = (FOLDER / EXAMPLES["selfcal"].study).read_bytes()
    (laid.folder / "sub" / "study.toml").write_bytes(study)
    words = " ".join(stored_line(line.split()).words(laid))
    assert not [each for each in ("store", "keep", "evil", "elsewhere", "cluster", "A ") if each in words]


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("allan /etc/passwd", "/etc/passwd"),
        ("allan ../../../etc/passwd", "../../../etc/passwd"),
        ("allan s3://bucket/log.csv", "s3:/bucket/log.csv"),
        ("allan http://evil/log.csv", "http:/evil/log.csv"),
        ("allan log.csv --map /etc/passwd", "/etc/passwd"),
        ("allan log.csv --map=/lab/other.toml", "/lab/other.toml"),
        ('allan \'["log.csv", "/etc/passwd"]\'', "/etc/passwd"),
        ("allan -- --map", "--map"),
        ("history 1234", "1234"),
        ("history log.csv --tolerance /etc/passwd", "/etc/passwd"),
        ("aoa log.csv --study /etc/passwd", "/etc/passwd"),
        ("aoa --runs /etc/passwd --study sub/study.toml", "/etc/passwd"),
        ("aoa log.csv --points --join /etc/passwd --study sub/study.toml", "/etc/passwd"),
        ("compare log.csv cal.json", "cal.json"),
    ],
)
def test_a_file_that_was_not_kept_is_refused(line, named, laid):
    with pytest.raises(InputError) as refused:
        stored_line(shlex.split(line)).words(laid)
    assert str(refused.value) == f"{named}: is not among the files kept with the result, expected one of them"


@pytest.mark.parametrize("name", ["/etc/passwd", "../../../../../../../../etc/passwd"])
@pytest.mark.parametrize("way", ["study", "--set", "--set of a table", "map", "map by the way", "runs"])
def test_a_file_that_another_names_is_refused_where_it_lies_elsewhere(way, name, laid):
    line = ["aoa", "log.csv", "--study", "sub/study.toml"]
    match way:
        case "study":
            study = laid.folder / "sub" / "study.toml"
            study.write_text(
                study.read_text().replace("[estimator]", "") + f'\n[estimator]\nprior = "{name}"\n'
            )
        case "--set":
            line += ["--set", f" estimator . prior = {name}"]
        case "--set of a table":
            line += [f'--set=estimator={{prior="{name}"}}']
        case "runs":
            (laid.folder / "gone.csv").write_text(f"file,role\n{name},run\n")
            line = ["aoa", "--study", "sub/study.toml", "--runs", "gone.csv"]
        case _:
            (laid.root / "absolute" / "lab" / "map.toml").write_text(
                f'[file.one]\npath = "{name}"\n[file.one.columns.acc_x]\nfrom = "a"\nunit = "m/s^2"\n'
                + ("[columns.acc_y]\nfrom = 'b'\nunit = 'm/s^2'\n" if way == "map" else "")
            )
            line = ["allan", "log.csv"] if way == "map" else line[:1] + line[2:]
            line += ["--map", "/lab/map.toml"]
    with pytest.raises(InputError, match=r"passwd: lies outside the files kept|passwd, which is not there"):
        stored_line(line).words(laid)


@pytest.mark.parametrize("way", ["study", "--set", "map", "runs"])
def test_a_kept_file_that_another_names_by_its_absolute_path_is_read_where_it_lies_now(way, laid):
    place = laid.root / "absolute" / "lab" / "other.csv"
    place.write_text("")
    laid = LaidOut(laid.root, laid.folder, {**laid.places, "/lab/other.csv": str(place)})
    study, column_map, table = laid.folder / "sub" / "study.toml", place.with_name("map.toml"), "gone.csv"
    study.write_text(study.read_text().replace("[motion]", '[motion]\nfile = "/elsewhere.csv"'))  # not read
    line, changed = ["aoa", "log.csv", "--study", "sub/study.toml"], study
    match way:
        case "study":
            study.write_text(study.read_text() + '\n[estimator]\nprior = "/lab/other.csv"\n')
        case "--set":
            line += ["--set", "estimator.prior=/lab/other.csv"]
        case "map":
            part = "path = '/lab/other.csv'\n[file.one.columns.acc_x]\nfrom = 'a'\nunit = 'g'\n"
            column_map.write_text(f"[file.one]\n{part}")
            line, changed = [*line[:1], *line[2:], "--map", "/lab/map.toml"], column_map
        case "runs":
            (laid.folder / table).write_text("file,role\n/lab/other.csv,run\n")
            line, changed = [*line[:1], *line[2:], "--runs", table], laid.folder / table
    words = stored_line(line).words(laid)
    assert str(place) in changed.read_text() or f"--set=estimator.prior={place}" in words


def test_whole_names_alone_are_replaced(laid):
    """Paths that are parts of others, and of the places themselves."""
    far = {
        path: f"{laid.root}/absolute{path}"
        for path in ("/a.csv", "/lab/a.csv", "/lab/a.csv.gz", "/x y/a.csv")
    }
    moved = LaidOut(laid.root, laid.folder, far).moved
    for path, place in far.items():
        for text in ("{}", "prior = '{}'", 'a=["{}"]', "{},run\r\n", 'estimator={{prior="{}"}}'):
            assert moved(text.format(path)) == text.format(place)
    for text in ("here/lab/a.csv", "/lab/a.csvs", "/lab/a.csv/b", "../a.csv", "/other/lab/a.csv", place):
        assert moved(text) == text


def test_names_that_begin_with_a_bracket_or_a_dash_stay_names(laid):
    """The parser takes a bracket for the beginning of a list."""
    bracket = '["/etc/passwd"]'
    places = {**laid.places, bracket: bracket, "-x.csv": "-x.csv"}
    line = stored_line(["allan", json.dumps([bracket])])
    words = line.words(LaidOut(laid.root, laid.folder, places))
    assert words[-2:] == ("--", f"./{bracket}")
    assert stored_line(words).given["FILES"] == (Path(bracket),)
    dash = stored_line(["allan", "--", "-x.csv"]).words(LaidOut(laid.root, laid.folder, places))
    assert stored_line(dash).given["FILES"] == (Path("-x.csv"),)


FILES = ("ferraris.csv.gz", "ferraris-map.toml", "ferraris.toml")
CALIBRATE = ["calibrate", "imu", "ferraris.csv.gz", "--map", "ferraris-map.toml", "--study", "ferraris.toml"]


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A sound result beside its files."""
    folder = tmp_path_factory.mktemp("sound")
    for name in FILES:
        (folder / name).write_bytes((FOLDER / name).read_bytes())
    before = Path.cwd()
    os.chdir(folder)
    try:
        assert run([*CALIBRATE, "--out", "cal.json", "--quiet"]) == 0
    finally:
        os.chdir(before)
    return json.loads((folder / "cal.json").read_text())


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder with the files of the result and an empty store."""
    work = tmp_path / "work"
    work.mkdir()
    for name in FILES:
        (work / name).write_bytes((FOLDER / name).read_bytes())
    monkeypatch.chdir(work)
    monkeypatch.setenv("INERCAL_STORE", str(tmp_path / "store"))
    assert run(["store", "init", "--quiet"]) == 0
    return work


def kept(lab, capsys, result, arguments, more=()):
    """The identity under which a result with another command line, and more files, was kept."""
    crafted = json.loads(json.dumps(result))
    crafted["provenance"]["arguments"] = arguments
    crafted["inputs"] += more
    (lab / "crafted.json").write_text(json.dumps(crafted))
    capsys.readouterr()
    assert run(["keep", "crafted.json", "--json", "--quiet"]) == 0
    return json.loads(capsys.readouterr().out)["result"]["id"]


def everything_below(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize(
    "line",
    [
        "certificate cal.json --lab lab.toml --number 7 --out {0}/x.xml --html {0}/mine.html",
        "store export {0}/copy",
        "batch fleet.csv --study ferraris.toml --out {0}/fleet --cluster tcp://127.0.0.1:9",
        "calibrate imu {0}/mine.html --study ferraris.toml",
        "schema --out {0}/mine.html",
    ],
)
def test_a_crafted_result_is_refused_in_one_sentence_and_nothing_is_touched(
    line, lab, tmp_path, capsys, result
):
    (tmp_path / "mine.html").write_text("mine")
    identity = kept(lab, capsys, result, line.format(tmp_path).split())
    before = everything_below(tmp_path)
    assert run(["rerun", identity[:10]]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"inercal: error: {identity[:10]}: ")
    assert err.count("\n") == 1
    assert "expected" in err
    assert everything_below(tmp_path) == before


def test_a_kept_file_is_read_and_never_imported(lab, tmp_path, capsys, result):
    """A module of Python among the files of a result lies in the folder in which its command runs."""
    (lab / "json.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    sha256 = hashlib.sha256((lab / "json.py").read_bytes()).hexdigest()
    identity = kept(lab, capsys, result, CALIBRATE, [{"path": "json.py", "sha256": sha256}])
    assert run(["rerun", identity[:10]]) == 0
    assert not (tmp_path / "ran").exists()


def test_settings_of_other_programs_are_not_laid_out(lab, tmp_path, capsys, result):
    """Libraries read files of hidden names from the folder they run in: numba's names a file that it writes."""
    (tmp_path / "victim.txt").write_text("precious")
    (lab / ".numba_config.yaml").write_text(f"chrome_trace: {tmp_path / 'victim.txt'}\n")
    sha256 = hashlib.sha256((lab / ".numba_config.yaml").read_bytes()).hexdigest()
    identity = kept(lab, capsys, result, CALIBRATE, [{"path": ".numba_config.yaml", "sha256": sha256}])
    (lab / ".numba_config.yaml").unlink()
    assert run(["rerun", identity[:10]]) == 2
    assert "has a hidden name" in capsys.readouterr().err
    assert (tmp_path / "victim.txt").read_text() == "precious"


def test_two_files_of_one_name_are_not_laid_one_over_the_other(tmp_path):
    """Names in which a secret was hidden may have become one."""
    objects = Objects(str(tmp_path / "objects"))
    one, other = objects.add(b"one"), objects.add(b"other")
    store = SimpleNamespace(objects=objects)
    same = SimpleNamespace(files=[("a=***", one, None), ("a=***", one, None)])
    assert laid_out(store, same, tmp_path / "same").places == {"a=***": "a=***"}
    two = SimpleNamespace(files=[("a=***", one, None), ("x/../a=***", other, None)])
    with pytest.raises(InputError, match="stands for two files of this result"):
        laid_out(store, two, tmp_path / "two")


@for_each("path", ["/dev/zero", "pipe"])
def test_a_result_that_names_a_device_or_a_pipe_is_not_waited_for(path, lab, capsys, result):
    if path == "pipe":
        os.mkfifo(lab / "pipe")
    identity = kept(lab, capsys, result, CALIBRATE, [{"path": path, "sha256": "0" * 64}])
    assert identity


def test_files_that_a_study_and_a_map_name_by_absolute_paths_are_those_kept(lab, tmp_path, capsys):
    """A study, a map and an option with absolute names, all files gone: the rerun reads what was kept."""
    from inercal.foundation.results.files import load

    far = tmp_path / "far away"
    far.mkdir()
    (lab / "ferraris.csv.gz").rename(far / "log.csv.gz")
    text = (lab / "ferraris-map.toml").read_text()
    named = text.replace("[columns]", f'[file.log]\npath = "{far}/log.csv.gz"\n[file.log.columns]')
    (lab / "ferraris-map.toml").write_text(named)
    words = ["calibrate", "imu", f"{far}/log.csv.gz", *CALIBRATE[3:]]
    assert run([*words, "--out", "cal.json", "--keep", "--quiet"]) == 0
    assert next(each.path for each in load(lab / "cal.json").inputs) == f"{far}/log.csv.gz"
    for path in (far / "log.csv.gz", lab / "ferraris-map.toml", lab / "ferraris.toml", lab / "cal.json"):
        path.unlink()
    capsys.readouterr()
    assert run(["results", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["result"]["results"]
    assert run(["rerun", row["id"]]) == 0
