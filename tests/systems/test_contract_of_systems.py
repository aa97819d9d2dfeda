"""Each system through all that its record offers, on a recording of its own new study: nothing here knows a system."""

import contextlib
import json
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from new_studies import FILL

import inercal as ic
from inercal.bench.workbench.pages.form import lines_of, named, with_lines
from inercal.cli import run
from inercal.cli.tree import COMMANDS
from inercal.faces.python.study import kind_of, read_study
from inercal.faces.stream.estimators import of_study
from inercal.faces.studies.schema import json_schema
from inercal.faces.studies.text import parsed, with_keys
from inercal.foundation.errors import InputError, QuantityError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.records.write import write_record
from inercal.foundation.units import STANDARD_GRAVITY, parse_unit
from inercal.systems.listed import SYSTEMS

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("undrawn")]

KEYS = [
    "inercal", "command", "status", "parameters", "covariance", "findings", "statistics", "budget", "model",
    "conditions", "traceability", "inputs", "timing_s", "provenance",
]  # fmt: skip
every_system = pytest.mark.parametrize("kind", SYSTEMS)


def those_with(offer):
    return pytest.mark.parametrize(
        "kind", [kind for kind, system in SYSTEMS.items() if getattr(system, offer)]
    )


@every_system
def test_a_new_study_is_of_its_system_and_of_no_other(kind, test_of, tmp_path):
    folder, study, _, _ = test_of(kind)
    system, path = SYSTEMS[kind], folder / "study.toml"
    assert (system.kind, study.system, kind_of(path)) == (kind, system, kind)
    schema = json_schema()
    own = {**schema, "anyOf": [{"$ref": f"#/$defs/{system.study_file().__name__}"}]}
    Draft202012Validator(own).validate(parsed(path.read_text()))
    assert type(ic.study(kind, **parsed(path.read_text())).settings) is type(study.settings)
    for other in SYSTEMS.keys() - {kind}:
        with pytest.raises(StudyError, match=f"a study for `inercal {system.command}`, expected one "):
            read_study(other, path)
    words = (*system.command.split(), "")[:2]
    assert {words, ("new", kind), ("simulate", kind)} <= COMMANDS.keys()
    assert system.title
    assert system.of


@every_system
def test_a_simulation_is_drawn_from_its_generator_alone(kind, test_of):
    _, study, record, _ = test_of(kind)
    again, other = (ic.simulate(study, np.random.default_rng(seed)) for seed in (1, 2))
    assert list(again.columns) == list(record.columns)
    for name, column in again.columns.items():
        np.testing.assert_allclose(column.values, record[name].values, rtol=1e-9, atol=1e-12)
    assert any(np.any(again[name].values != other[name].values) for name in again.columns)


def refused(capsys, words, says):
    """Exit code 2, nothing on standard output, one sentence that says so on standard error."""
    capsys.readouterr()
    assert run([*map(str, words)]) == 2, words
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.replace("compiling kernels, once\n", "").splitlines()
    assert line.startswith("inercal: error: ")
    assert says in line


@every_system
def test_the_command_simulates_what_the_verb_does(kind, test_of, tmp_path, capsys):
    folder, study, record, _ = test_of(kind)
    words = ["simulate", kind, folder / "study.toml"]
    out = tmp_path / "by_command.csv"
    assert run([*map(str, [*words, "--seed", 2, "--out", out, "--json", "--quiet"])]) == 0
    made = json.loads(capsys.readouterr().out)
    rows = len(next(iter(record.columns.values())).t)
    assert (made["command"], made["status"]["code"]) == (f"simulate {kind}", "ok")
    assert made["result"] == {"out": str(out), "rows": rows, "seed": 2, "columns": list(record.columns)}
    assert made["inputs"][0]["path"] == str(folder / "study.toml")
    write_record(ic.simulate(study, np.random.default_rng(2)), tmp_path / "by_verb.csv")
    assert out.read_bytes() == (tmp_path / "by_verb.csv").read_bytes()
    before = sorted(tmp_path.iterdir())
    (other,) = [name for name in SYSTEMS if name != kind][:1]
    for more, says in (
        ([], "--out"),
        (["--out", tmp_path / "run.xlsx"], "'.xlsx'"),
        (["--out", tmp_path / "run.csv", "--seed", "-1"], "--seed: found -1"),
    ):
        refused(capsys, [*words, *more], says)
    words = ["simulate", other, folder / "study.toml", "--out", tmp_path / "run.csv"]
    refused(capsys, words, f"a study for `inercal {SYSTEMS[kind].command}`")
    assert sorted(tmp_path.iterdir()) == before


@every_system
def test_new_writes_a_study_for_a_recording_and_overwrites_none(kind, test_of, tmp_path, capsys):
    folder, study, record, _ = test_of(kind)
    words = ["new", kind, folder / "log.csv", "--out", tmp_path / "new.toml", *FILL]
    assert run([*map(str, words), "--json", "--quiet"]) == 0
    made = json.loads(capsys.readouterr().out)["result"]
    assert made["study"] == str(tmp_path / "new.toml")
    assert (made["map"] is None) == SYSTEMS[kind].complete(record.columns)
    text = (tmp_path / "new.toml").read_text()
    assert f"# Next: inercal {SYSTEMS[kind].command} {folder / 'log.csv'}" in text
    assert type(read_study(kind, tmp_path / "new.toml").settings) is type(study.settings)
    refused(capsys, words, "exists already")


@every_system
def test_what_cannot_be_used_is_one_sentence_and_nothing_is_written(kind, test_of, tmp_path, capsys):
    folder, _, _, _ = test_of(kind)
    log, study = folder / "log.csv", ("--study", folder / "study.toml")
    text = log.read_text().splitlines()
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "header.csv").write_text(text[0] + "\n")
    (tmp_path / "warm.csv").write_text("t [s],temperature [degC]\n0,20\n1,20\n2,21\n")
    (tmp_path / "noise.bin").write_bytes(np.random.default_rng(1).bytes(4000))
    before = sorted(tmp_path.iterdir())
    words = SYSTEMS[kind].command.split()
    tried = [
        ((tmp_path / "none.csv", *study), "none.csv"),
        ((tmp_path / "empty.csv", *study), "empty.csv"),
        ((tmp_path / "header.csv", *study), "header.csv"),
        ((tmp_path / "warm.csv", *study), "warm.csv"),
        ((tmp_path / "noise.bin", *study), "noise.bin"),
        ((log,), "--study"),
        ((log, "--study", tmp_path / "none.toml"), "none.toml"),
        ((log, "--study", log), "log.csv"),
        ((log, *study, "--set", "site.gravty=9.81 m/s^2"), "gravity"),
        ((log, *study, "--set", "site.gravity=9.81 deg"), "site.gravity"),
        ((log, *study, "--out", tmp_path / "cal.txt"), ".json"),
        ((log, *study, "--out", folder / "study.toml"), "is an input"),
        ((log, *study, "--report", tmp_path / "page.pdf"), ".html"),
        ((log, *study, "--begin", "1e9 s"), "--begin"),
        ((log, *study, "--nonesuch"), "--nonesuch"),
    ]
    for arguments, says in tried:
        refused(capsys, [*words, *arguments], says)
        refused(capsys, [*words, *arguments, "--json"], says)
    assert sorted(tmp_path.iterdir()) == before


@every_system
def test_a_command_finds_what_the_verb_finds(kind, test_of, tmp_path, capsys):
    """The options that every calibration has are not ignored: keys, span, files out."""
    folder, _, record, _ = test_of(kind)
    out, page = tmp_path / "cal.json", tmp_path / "cal.html"
    words = [*SYSTEMS[kind].command.split(), folder / "log.csv", "--study", folder / "study.toml"]
    words += ["--set", "traceability.operator=Ada", "--out", out, "--report", page, "--quiet"]
    end = f"{0.9 * next(iter(record.columns.values())).t[-1]:.4f} s"
    code = run([*map(str, words), "--end", end])
    data = json.loads(out.read_text())
    found = ic.calibrate(
        record.between(None, end),
        read_study(kind, folder / "study.toml", ["traceability.operator=Ada"]),
    )
    assert list(data)[: len(KEYS)] == KEYS
    assert data["command"] == SYSTEMS[kind].command
    assert data["status"] == {"code": found.status.value, "message": found.message}
    assert code == (found.status is not Status.OK)
    assert {each["name"]: each["value"] for each in data["parameters"]} == found.values
    assert data["traceability"]["operator"] == "Ada"
    assert data["provenance"]["span"]
    assert {each["path"] for each in data["inputs"]} >= {str(folder / "log.csv"), str(folder / "study.toml")}
    assert [each["code"] for each in data["findings"]] == [each.code for each in found.findings]
    assert data["budget"] or not found.names
    assert data["references"]
    assert found.table() in capsys.readouterr().out
    assert page.read_text("utf-8").lower().startswith("<!doctype html>")


@every_system
@pytest.mark.parametrize("spoilt", [False, True])
def test_a_result_is_shown_saved_and_loaded_whatever_its_verdict(kind, spoilt, test_of, tmp_path):
    _, study, record, result = test_of(kind)
    rows = len(next(iter(record.columns.values())).t)
    for lateness in (3, rows // 60) if spoilt else ():  # each channel is late by another time
        late = {
            name: replace(column, values=np.roll(column.values, lateness * place))
            for place, (name, column) in enumerate(record.columns.items())
        }
        result = ic.calibrate(replace(record, columns=late), study)
        if result.status is not Status.OK:
            break
    assert not (spoilt and result.status is Status.OK)
    assert len(repr(result).splitlines()) == 3
    assert result.plot().axes
    page = unescape(result.report(tmp_path / "page.html").read_text("utf-8"))
    assert result.message in page
    assert all(finding.headline in page for finding in result.findings)
    assert all(name in page for name in result.names)
    frame = result.to_dataframe()
    assert list(frame["value_si"]) == list(result.values.values())
    assert list(frame["unit"]) == list(result.view.shown.units)
    assert list(frame["value"]) == result.view.shown.values.tolist()
    np.testing.assert_array_equal(result.to_xarray()["covariance"], result.estimate.covariance)
    again = ic.load(result.save(tmp_path / "cal.json"))
    assert again.values == result.values
    assert again.view.shown.units == result.view.shown.units
    assert again.view.answer == result.view.answer
    assert again.status is result.status
    assert again.report(tmp_path / "again.html").exists()
    if result.view.rows is not None:
        assert result.save(tmp_path / "rows.csv").stat().st_size > 1000


@every_system
def test_a_page_and_its_pictures_stand_at_every_verdict(kind, test_of, tmp_path):
    """That of the calibration, which has its evidence, and that of a saved result."""
    _, _, _, result = test_of(kind)
    saved = json.loads(result.save(tmp_path / "cal.json").read_text())
    found = {id(each): each for each in (result.estimate, result.view.shown, result.evidence.estimate)}
    was = result.status, result.message
    try:
        for status in Status:
            for estimate in found.values():
                object.__setattr__(estimate, "status", status)
                object.__setattr__(estimate, "message", "the verdict in a sentence")
            assert "the verdict in a sentence" in result.view.page()
            assert result.plot().axes
            if status not in (Status.OK, Status.UNOBSERVABLE):
                continue
            verdict = {"code": status.value, "message": "the verdict in a sentence"}
            (tmp_path / "other.json").write_text(json.dumps({**saved, "status": verdict}))
            again = ic.load(tmp_path / "other.json")
            assert again.status is status
            assert "the verdict in a sentence" in again.view.page()
            assert again.plot().axes
    finally:
        for estimate in found.values():
            object.__setattr__(estimate, "status", was[0])
            object.__setattr__(estimate, "message", was[1])


@every_system
def test_the_budget_adds_up_and_units_are_those_they_say(kind, test_of):
    """Shares of the sources are the whole of each variance; a value in its unit is the one in SI."""
    _, _, _, result = test_of(kind)
    estimate, shown = result.estimate, result.view.shown
    for name in estimate.names:
        assert sum(item.share.get(name, 0.0) for item in estimate.budget) == pytest.approx(1.0, abs=1e-4), (
            name
        )
    checked = 0
    for name, unit, value, si in zip(estimate.names, shown.units, shown.values, estimate.values, strict=True):
        plain, per, power = unit.partition("/g")
        with contextlib.suppress(QuantityError):  # a unit of the field alone
            size = value * parse_unit(plain).factor
            by_gravity = size / STANDARD_GRAVITY ** float(power.lstrip("^") or 1) if per else size
            assert si in (pytest.approx(size, rel=5e-3), pytest.approx(by_gravity, rel=5e-3)), name
            checked += 1
    assert checked or not estimate.names


@every_system
def test_repeat_runs_are_one_result_or_refused(kind, test_of, tmp_path):
    _, study, record, result = test_of(kind)
    other = ic.simulate(study, np.random.default_rng(2))
    try:
        both, refusal = ic.calibrate([record, other], study), ""
    except InputError as error:
        both, refusal = None, str(error)
    if both is None:
        assert "expected one run" in refusal
        return
    alone = ic.calibrate(other, study)
    if not (result.status.done and alone.status.done):
        assert not both.status.done
        return
    assert len(both.evidence) == 2
    by_run = both.estimate.result["by_run"]
    for name in both.names:
        assert by_run[name]["values"] == [result.values[name], alone.values[name]]
        low, high = sorted(by_run[name]["values"])
        assert low - 1e-9 * abs(low) <= both.values[name] <= high + 1e-9 * abs(high)
    assert both.report(tmp_path / "page.html").stat().st_size > 10_000


@every_system
def test_what_a_system_does_not_offer_is_refused_in_a_sentence(kind, test_of):
    _, study, record, _ = test_of(kind)
    system = SYSTEMS[kind]
    if not system.compares:
        with pytest.raises(InputError, match=f"a study of kind {kind}, expected one of "):
            ic.calibrate(record, study, compare=True)
    if not system.sensitivity:
        with pytest.raises(InputError, match=f"a study of kind {kind}, expected one of "):
            ic.sensitivity(study)
    if not system.stream:
        with pytest.raises(StudyError, match=f"is of the kind {kind}, expected "):
            of_study(study, 0.0, print, print)
    if not system.runs:
        with pytest.raises(StudyError, match=f"is of kind {kind}, expected one of "):
            ic.runs("runs.csv", study)
    with pytest.raises(InputError, match=f"found 'none' of a study of kind {kind}, expected "):
        ic.design(study, "none")


@those_with("designs")
def test_designs_and_sensitivity_are_results(kind, test_of, tmp_path):
    _, study, _, _ = test_of(kind)
    results = [(f"design {name}", ic.design(study, name)) for name in SYSTEMS[kind].designs]
    if SYSTEMS[kind].sensitivity:
        results.append(("sensitivity", ic.sensitivity(study)))
    for command, result in results:
        assert result.estimate.command == command
        assert tuple([*command.split(), ""][:2]) in COMMANDS
        assert result.estimate.references
        assert result.table()
        assert result.plot().axes
        assert result.report(tmp_path / "page.html").stat().st_size > 5000
        assert (
            ic.load(result.save(tmp_path / "design.json")).estimate.result.keys()
            == result.estimate.result.keys()
        )


@those_with("foresight")
def test_a_plan_is_foreseen_and_said_in_lines(kind, test_of, tmp_path):
    folder, study, _, _ = test_of(kind)
    system, text = SYSTEMS[kind], (folder / "study.toml").read_text()
    seen = system.foresight(study.settings)
    stated = seen.u(np.ones(len(seen.levers)))
    assert stated.shape == (len(seen.names),)
    assert np.all(seen.u(np.full(len(seen.levers), 2.0)) >= stated)
    assert system.verticals(study.settings).shape[1] == 3
    path = tmp_path / "study.toml"
    lines = lines_of(study)
    path.write_text(with_lines(system.plan, text, lines))
    assert lines_of(read_study(kind, path)) == lines
    assert system.plan.design in system.designs
    for keys in named(system.plan).values():
        path.write_text(with_keys(text, keys))
        assert lines_of(read_study(kind, path))


@every_system
def test_a_system_is_validated(kind):
    assert SYSTEMS[kind].shows
    assert SYSTEMS[kind].cases()
