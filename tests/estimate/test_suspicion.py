"""A result is suspect where a finding does harm, and only there."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import inercal
from inercal.foundation.findings import CODES, EVERYTHING, Finding, Harm, Status, causes, settled
from inercal.foundation.instruments.terms import resting_on
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.files import from_json, to_json
from inercal.foundation.results.result import Estimate
from rows import for_each

NAMES = ("K0_x", "D_F_x", "S_x")
GYRO = ("D_F_x", "S_x")


def estimate(*findings, status=Status.OK, names=NAMES, beside=()):
    p = len(names)
    known = Uncertainty(np.eye(p), np.full(p, np.inf))
    basis, verdict = Basis("calibrate imu"), (status, "done")
    units = ("1",) * p
    return Estimate.of(basis, names, units, np.ones(p), known, verdict, findings=findings, beside=beside)


def finding(code, harm=()):
    return Finding(code, "", "", harm)


def calls_of_finding():
    for path in Path(inercal.__file__).parent.rglob("*.py"):
        if (
            path.name in ("files.py", "findings.py") or "stream" in path.parts
        ):  # read from a file; no result follows
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding":
                yield path.name, node


def test_whoever_finds_something_that_harms_by_size_says_what_it_harms():
    """Each call of Finding with such a code, or with one that is not written there, states the harm."""
    silent = []
    for where, node in calls_of_finding():
        stated = len(node.args) > 3 or any(each.arg == "harm" for each in node.keywords)
        code = node.args[0].value if isinstance(node.args[0], ast.Constant) else None
        if not stated and (code is None or CODES[code].harm is Harm.BY_SIZE):
            silent.append(f"{where}:{node.lineno} {code}")
    # codes of the reader never do harm, whichever of them it is
    allowed = {"coefficients.py", "outcome.py"}
    assert [each for each in silent if not (each.endswith("None") and each.split(":")[0] in allowed)] == []


@pytest.mark.parametrize("code", CODES)
def test_harm_of_a_code(code):
    match CODES[code].harm:
        case Harm.NEVER:
            assert estimate(finding(code)).status is Status.OK
            with pytest.raises(ValueError, match="do no harm"):
                finding(code, EVERYTHING)
        case Harm.BY_SIZE:
            assert estimate(finding(code)).status is Status.OK
            assert estimate(finding(code, ("S_x",))).status is Status.SUSPECT
        case Harm.ALWAYS:
            found = estimate(finding(code))
            assert found.status is Status.SUSPECT
            assert found.findings[0].harm == NAMES


@pytest.mark.parametrize("status", [each for each in Status if not each.done])
def test_another_status_stays(status):
    found = estimate(finding("contradiction", EVERYTHING), status=status)
    assert (found.status, found.message) == (status, "done")
    assert found.findings[0].harm == NAMES


def test_the_message_names_what_is_harmed():
    one = estimate(finding("bias_drift", ("D_F_x",)))
    assert one.message == "done; but see bias_drift: D_F_x may be off by more than its u"
    whole = estimate(finding("contradiction", EVERYTHING))
    assert whole.message == "done; but see contradiction: values may be off by more than their u"
    angle = estimate(finding("flexure", ("theta",)), names=(), beside=("theta",))
    assert angle.message == "done; but see flexure: theta may be off by more than its u"


def test_harm_to_a_channel_is_harm_to_what_rests_on_it():
    assert estimate(finding("saturation", ("gyro_y",))).findings[0].harm == GYRO
    assert resting_on("gyro_x", ("N_gyro_x", "N_gyro_y")) == ("N_gyro_x",)
    assert resting_on("acc_x", ("acc_x", "acc_x_T1", "gyro_x")) == ("acc_x", "acc_x_T1")
    assert resting_on("y_y", ("DX_F", "k_x", "DY_F", "kY_x")) == ("DY_F", "kY_x")
    assert resting_on("th_x", ("kg0_x", "ka0_x")) == ("kg0_x", "ka0_x")
    assert resting_on("acc_x", ("kg0_x", "ka0_x")) == ("kg0_x", "ka0_x")
    assert resting_on("t", ("N_gyro_x", "K0_x")) == ("N_gyro_x", "K0_x")
    assert resting_on("temperature", ("acc_x", "acc_x_T1")) == ("acc_x", "acc_x_T1")


@for_each(
    ("channel", "names"),
    [
        ("gyro_x", ("K0_x", "K1_x", "M_xy")),
        ("acc_x", ("D_F_x", "S_x")),
        ("y_x", ("DY_F", "kY_x")),
        ("gyro_x", ("N_gyro_y", "B_gyro_y")),
        ("a1", ("N_a2",)),
        ("th_x", ("N_gyro_y",)),
        ("acc_x", ("gyro_x", "gyro_x_T1")),
        ("temperature", ("K0_x", "D_F_x", "b_1")),
    ],
)
def test_a_channel_on_which_nothing_rests_harms_nothing(channel, names):
    assert resting_on(channel, names) == ()
    harmless = estimate(finding("saturation", (channel,)), names=names)
    assert (harmless.status, harmless.findings[0].harm) == (Status.OK, ())


def test_a_result_that_estimates_nothing_cannot_be_harmed():
    """As of `inercal inspect`, whose findings name channels."""
    found = estimate(finding("saturation", ("acc_x",)), names=())
    assert found.status is Status.OK
    assert found.findings[0].harm == ("acc_x",)


def test_what_was_left_out_does_no_harm():
    findings = (finding("saturation", ("acc_x",)), finding("unit_suspect", ("acc_x",)))
    assert [each.harm for each in settled(findings, "saturation")] == [(), ("acc_x",)]


def test_harm_survives_a_file_and_old_files_have_none():
    found = estimate(finding("bias_drift", ("D_F_x",)), finding("gap"))
    data = to_json(found)
    assert [each["harm"] for each in data["findings"]] == [["D_F_x"], []]
    assert from_json(data).findings == found.findings
    for each in data["findings"]:
        del each["harm"]
    assert from_json(data).findings == tuple(replace(each, harm=()) for each in found.findings)


def test_causes_are_told_by_their_rank():
    told = causes(
        [finding("outlier"), finding("gap"), finding("nan"), finding("unit_suspect"), finding("unmodelled")]
    )
    assert [each.code for each in told] == ["unit_suspect", "unmodelled", "gap", "outlier"]
    ranks = [each.rank for each in CODES.values() if each.rank]
    assert len(ranks) == len(set(ranks))
    assert {code for code, each in CODES.items() if each.gross} == {
        "unit_suspect", "channel_swap", "sign_suspect", "command_shift", "row_order",
    }  # fmt: skip
