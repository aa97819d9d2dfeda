"""Each system that has a stream through all that a stream has: nothing here knows a system."""

import io

import numpy as np
import pytest
from test_contract_of_systems import refused

from inercal.cli import run
from inercal.cli.tree import app
from inercal.faces.python.study import read_study
from inercal.faces.stream import run as stream
from inercal.faces.stream.estimators import of_study
from inercal.faces.stream.lines import Lines
from inercal.systems.listed import SYSTEMS

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("undrawn")]

#: keys with which a file tells a stream nothing that it does not know
STATED = {
    "selfcal": ("model.states=paper",),
    "aoa": ("band.low_pass=none", "estimator.snap=1e8 rad^2/s^7"),
}
STREAMED = [kind for kind, system in SYSTEMS.items() if system.stream]
every_stream = pytest.mark.parametrize("kind", STREAMED)


def streamed(study, lines, checkpoint=None, every=0.0, said=None):
    """Lines that the estimator of a study gives for lines."""
    made = []
    given = Lines(io.BytesIO("".join(lines).encode()), "lines", None, lambda finding: None)
    say = (lambda finding: None) if said is None else (lambda finding: said.append(finding.line))
    estimator = of_study(study, every, lambda text: None, say)(given)
    saving = None if checkpoint is None else stream.Saving(checkpoint, 100)
    stream.run(estimator, given, made.append, saving, lambda text: None, -np.inf)
    return made


def log_of(folder):
    return (folder / "log.csv").read_text().splitlines(keepends=True)


@every_stream
def test_a_stream_gives_the_numbers_of_the_file_however_often_it_is_stopped(kind, test_of, tmp_path):
    folder, study, _, result = test_of(kind)
    lines = log_of(folder)
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


@pytest.mark.parametrize("kind", STATED)
def test_where_a_study_states_all_a_stream_gives_the_bytes_of_the_file(kind, test_of, tmp_path):
    folder, _, _, _ = test_of(kind)
    keys = [word for key in STATED[kind] for word in ("--set", key)]
    words = [*SYSTEMS[kind].command.split(), str(folder / "log.csv"), "--study", str(folder / "study.toml")]
    assert run([*words, *keys, "--out", str(tmp_path / "rows.csv"), "--quiet"]) in (0, 1)
    stated = read_study(kind, folder / "study.toml", STATED[kind])
    assert streamed(stated, log_of(folder)) == (tmp_path / "rows.csv").read_text().splitlines()


@every_stream
def test_a_line_each_interval_is_one_of_all_lines(kind, test_of):
    """The first of each, of those that are counted from the first one."""
    folder, study, record, _ = test_of(kind)
    stamps = next(iter(record.columns.values())).t
    every = float(stamps[-1] - stamps[0]) / 10.0
    titles, *whole = streamed(study, log_of(folder))
    rare = streamed(study, log_of(folder), every=every)
    assert rare[0] == titles
    assert 1 < len(rare[1:]) <= 11
    assert set(rare[1:]) <= set(whole)
    times = np.array([float(line.split(",")[0]) for line in rare[1:]])
    assert len({*np.floor((times - times[0]) / every + 1e-9)}) == len(times)


@every_stream
def test_what_was_said_is_not_said_again_after_a_stop(kind, test_of, tmp_path):
    """Channels that are late by another time contradict a model; where that is said, it is said once."""
    folder, study, _, _ = test_of(kind)
    titles, *rows = (line.rstrip("\n").split(",") for line in log_of(folder)[:800])
    table = np.array(rows, dtype=object)
    for place in range(2, table.shape[1]):
        table[:, place] = np.roll(table[:, place], 40 * place)
    spoilt = [",".join(row) + "\n" for row in [titles, *table.tolist()]]
    whole, parts, state = list[str](), list[str](), tmp_path / "state"
    streamed(study, spoilt, said=whole)
    for end in (len(spoilt) * 2 // 3, len(spoilt)):
        streamed(study, spoilt[:end], state, said=parts)
    assert parts == whole


@every_stream
def test_a_command_with_a_stream_refuses_what_is_for_files(kind, test_of, tmp_path, capsys):
    folder, _, _, _ = test_of(kind)
    words = SYSTEMS[kind].command.split()
    command = app()[words[0]][words[1]] if len(words) > 1 else app()[words[0]]
    options = {name for each in command.assemble_argument_collection() for name in each.names}
    if "--stream" not in options:
        assert kind == "imu"  # whose stream is a command of its own
        return
    log, study = folder / "log.csv", ("--study", folder / "study.toml")
    whole = (*words, log, *study)
    state, out = tmp_path / "state", tmp_path / "out.csv"
    tried = [
        ((*words, *study), "FILES is missing"),
        ((*whole, "--checkpoint", state), "--stream"),
        ((*whole, "--stream", "--checkpoint", log), "is an input"),
        ((*words, log, folder / "study.toml", *study, "--stream"), "2 files"),
        ((*whole, "--stream", "--json"), "--json"),
        ((*whole, "--stream", "--out", out), "--out"),
        ((*whole, "--stream", "--report", tmp_path / "page.html"), "--report"),
        ((*whole, "--stream", "--compare"), "--compare"),
        ((*whole, "--every", "1 s"), "--stream"),
        ((*whole, "--stream", "--every", "0 s"), "above 0"),
    ]
    for arguments, says in tried:
        if {"--compare", "--every"} & {*map(str, arguments)} - options:
            continue
        refused(capsys, arguments, says)
    assert not list(tmp_path.iterdir())
