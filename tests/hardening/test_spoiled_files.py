"""Files that are spoiled at random, their structure known: benchmarks/spoiled_files.py, 200 of each format.

The test run reads 20 of each in a process of their own, `make campaign` the rest. A crash or a hang of it, an
error that is not one sentence, and a value that differs from a strict parser's without a finding are faults of ours.
"""

import os

import numpy as np
import pytest
import spoiled_files
from spoiled import strict, whole

from inercal.foundation.records.read import limits

CASES, SHORT = 200, 20

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="many children, which are forks")


@pytest.mark.slow
@pytest.mark.parametrize(
    "cases",
    [range(SHORT), pytest.param(range(SHORT, CASES), marks=pytest.mark.campaign)],
    ids=["short", "rest"],
)
@pytest.mark.parametrize("name", whole.FORMATS)
def test_spoiled_files_are_read_or_refused(name, cases, monkeypatch):
    monkeypatch.setattr(limits, "seconds", lambda size: 2)
    monkeypatch.setattr(spoiled_files.child, "_PATIENCE", 100)
    counts, faults, _ = spoiled_files.campaign(name, cases)
    assert faults == {}
    assert sum(counts.values()) == len(cases)
    assert counts["refused"] < len(cases) or name == "checkpoint"


@pytest.mark.slow
def test_whole_files_are_read_as_strictly(tmp_path):
    """The strict parsers and inercal agree on what nobody has spoiled; the parsers take every format."""
    for name, (suffix, _, text) in whole.FORMATS.items():
        path = tmp_path / f"a{suffix}"
        path.write_bytes(whole.content(name))
        columns, codes = spoiled_files.read(name, path, tmp_path)
        assert not codes & spoiled_files.ON_READING, name
        wanted = strict.columns(name, path)
        assert (wanted is not None) == (name in spoiled_files.STRICT), name
        for each, values in (wanted or {}).items():
            np.testing.assert_allclose(columns[each], values, rtol=0, atol=1e-9, err_msg=name)
        assert text is None or columns.keys() >= {"acc_x", "gyro_x"}


@pytest.mark.slow
def test_a_fault_is_seen(monkeypatch):
    """A reader that crashes, one that hangs, and one that gives another number."""

    def reads(how, cases=3):
        monkeypatch.setattr(spoiled_files, "read", how)
        return spoiled_files.campaign("raw binary", range(cases))

    def hang(*_):
        while True:
            pass

    monkeypatch.setattr(limits, "seconds", lambda size: 1)
    monkeypatch.setattr(spoiled_files, "case", lambda name, number: whole.content(name))
    other = {**whole.VALUES, "acc_x": whole.VALUES["acc_x"] + 1e-9}
    assert reads(lambda *_: (whole.VALUES, set()))[:2] == ({"read": 3}, {})
    assert set(reads(lambda *_: (other, set()))[1].values()) == {"acc_x differs from the strict parser's"}
    assert reads(lambda *_: (other, {"bad_row"}))[0] == {"read with findings": 3}
    assert all("crashed its reader" in text for text in reads(lambda *_: os.abort())[1].values())
    assert len(reads(hang, 1)[1]) == 1
