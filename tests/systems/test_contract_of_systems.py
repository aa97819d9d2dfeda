"""Each system through all that its record offers, on a recording of its own new study: nothing here knows a system."""

import functools
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from new_studies import filled

import inercal as ic
from inercal.bench.workbench.pages.form import lines_of, named, with_lines
from inercal.cli import run
from inercal.cli.tree import COMMANDS
from inercal.faces.python.study import kind_of, read_study
from inercal.faces.stream import run as stream
from inercal.faces.stream.estimators import of_study
from inercal.faces.stream.lines import Lines
from inercal.faces.studies.schema import json_schema
from inercal.faces.studies.text import parsed, with_keys
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.records.write import write_record
from inercal.systems.listed import SYSTEMS

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("undrawn")]

#: keys that make the test of a new study short
SHORT = {
    "turntable": ("positions.plan=24-position", 'goal={ DX_F = "1 deg/h" }', "design.positions=12"),
    "selfcal": ("design.turns=1",),
    "strapdown": ("plan.sample_rate=25 Hz",),
    "aoa": ("motion.duration=12 s", "motion.sample_rate=250 Hz"),
}
KEYS = [
    "inercal", "command", "status", "parameters", "covariance", "findings", "statistics", "budget", "model",
    "conditions", "traceability", "inputs", "timing_s", "provenance",
]  # fmt: skip
every_system = pytest.mark.parametrize("kind", SYSTEMS)


def those_with(offer):
    return pytest.mark.parametrize(
        "kind", [kind for kind, system in SYSTEMS.items() if getattr(system, offer)]
    )


@pytest.fixture(scope="module")
def test_of(tmp_path_factory):
    """Of a kind: the folder of study and recording, the study, the record, the result; made once."""
    root = tmp_path_factory.mktemp("systems")

    @functools.cache
    def made(kind):
        folder = root / kind
        folder.mkdir()
        (folder / "study.toml").write_text(filled(kind, overrides=SHORT.get(kind, ())))
        study = read_study(kind, folder / "study.toml")
        write_record(ic.simulate(study, np.random.default_rng(1)), folder / "log.csv")
        record = ic.read(folder / "log.csv")
        return folder, study, record, ic.calibrate(record, study)

    return made


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
    assert result.report(tmp_path / "page.html").stat().st_size > 10_000
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
    _, _, _, result = test_of(kind)
    saved = json.loads(result.save(tmp_path / "cal.json").read_text())
    for status in Status:
        verdict = {"code": status.value, "message": "the verdict in a sentence"}
        (tmp_path / "other.json").write_text(json.dumps({**saved, "status": verdict}))
        again = ic.load(tmp_path / "other.json")
        assert again.status is status
        assert "the verdict in a sentence" in again.view.page()
        assert again.plot().axes


def streamed(study, lines, checkpoint=None):
    """Lines that the estimator of a study gives for lines."""
    made = []
    given = Lines(io.BytesIO("".join(lines).encode()), "lines", None, lambda finding: None)
    estimator = of_study(study, 0.0, lambda text: None, lambda finding: None)(given)
    saving = None if checkpoint is None else stream.Saving(checkpoint, 100)
    stream.run(estimator, given, made.append, saving, lambda text: None, -np.inf)
    return made


@those_with("stream")
def test_a_stream_gives_the_numbers_of_the_file_however_often_it_is_stopped(kind, test_of, tmp_path):
    folder, study, _, result = test_of(kind)
    lines = (folder / "log.csv").read_text().splitlines(keepends=True)
    whole = streamed(study, lines)
    assert len(whole) > 2
    state = tmp_path / "state"
    parts = [*streamed(study, lines[: 1 + len(lines) // 2], state), *streamed(study, lines, state)]
    last = {line.split(",")[0]: line for line in parts}  # what an end gave too early is given once more
    assert [last[line.split(",")[0]] for line in whole] == whole
    if result.view.rows is None:
        return
    rows = result.view.rows()
    names = [name.split(" [")[0] for name in whole[0].split(",")]
    last = {name: float(word or "nan") for name, word in zip(names, whole[-1].split(","), strict=True)}
    shared = [name for name in names if name in rows.columns and f"u_{name}" in names]
    assert shared
    for name in shared:  # a file is gone through a second time, with what the first has found
        assert rows[name].values[-1] == pytest.approx(last[name], rel=0, abs=0.5 * last[f"u_{name}"]), name


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
