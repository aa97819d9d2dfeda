"""Searches and sampled sensitivity by one process, two, and a cluster: the same digits."""

import socket
from contextlib import suppress

import numpy as np
import pytest

import inercal as ic
from inercal.cli import run
from inercal.examples import FOLDER
from inercal.faces.python.study import read_study
from inercal.foundation.computing.cluster import Cluster
from inercal.foundation.computing.executors import Processes, Threads, numbered
from inercal.systems.selfcal import verbs as selfcal
from inercal.systems.turntable import verbs as turntable

TABLE = ic.study(
    "turntable",
    latitude="45 deg",
    rig={"kind": "two_axis_turntable", "errors": {"default": {"uniform": "2 arcmin"}}},
    instrument={"kind": "accelerometer", "unit": "g", "noise": "10 ug"},
    positions={"plan": "24-position"},
    analysis={"method": "sampled", "samples": 64, "outputs": ["ax", "ay"]},
    design={"positions": 12, "candidates": {"phi1": 8, "phi2": 8}},
)
PLATFORM = read_study(
    "selfcal", FOLDER / "selfcal.toml", ["design.turns=2", 'design.angle="90 deg"', 'design.time="400 s"']
)


def found(study, work, executor):
    """What does not tell of time."""
    return work(study, executor=executor).estimate.result


@pytest.mark.slow
@pytest.mark.parametrize(
    ("study", "work"),
    [
        (TABLE, turntable.sensitivity),
        pytest.param(TABLE, turntable.design, marks=pytest.mark.campaign),
        pytest.param(PLATFORM, selfcal.design, marks=pytest.mark.campaign),
    ],
    ids=["sensitivity", "positions", "selfcal"],
)
def test_two_processes_give_the_same_digits(study, work):
    np.testing.assert_equal(found(study, work, Processes(2)), found(study, work, None))


def negative(number):
    """Work that tells its number."""
    return -number


def test_answers_come_in_the_order_of_their_numbers():
    told = []
    assert numbered(negative, 200, Threads(3), lambda done, count: told.append((done, count))) == [
        -n for n in range(200)
    ]
    assert told[0] == (0, 200)
    assert told[-1] == (200, 200)
    assert numbered(negative, 0) == []


@pytest.mark.slow
def test_a_cluster_gives_the_same_digits_whoever_has_the_port_of_dashboards():
    pytest.importorskip("distributed")
    with socket.socket() as other:
        with suppress(OSError):  # whoever has it already does as well
            other.bind(("0.0.0.0", 8787))
            other.listen()
        of_cluster = found(TABLE, turntable.sensitivity, Cluster("local", 2))

    np.testing.assert_equal(of_cluster, found(TABLE, turntable.sensitivity, None))


@pytest.mark.parametrize("verb", [["sensitivity"], ["design", "positions"], ["design", "selfcal"]])
def test_places_are_refused_in_words(verb, tmp_path, capsys):
    study = tmp_path / "study.toml"
    study.write_text("")
    assert run([*verb, str(study), "--workers", "0"]) == 2
    assert "--workers: found 0, expected 1 or more" in capsys.readouterr().err
    assert run([*verb, str(study), "--workers", "2", "--cluster", "tcp://127.0.0.1:1"]) == 2
    assert "--workers: found beside the cluster" in capsys.readouterr().err
