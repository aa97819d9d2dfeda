"""Findings: what they hold, their JSON, and the three ways in which people see them."""

import ast
from pathlib import Path

import pytest

import inercal
from inercal.bench.workbench.pages.form import Advice, advice_of
from inercal.cli.options import OutputOptions, ReportOutput
from inercal.cli.outcome import say_findings
from inercal.faces.report.html import render
from inercal.foundation.findings import EVERYTHING, Finding, most_harmful, with_alternatives
from inercal.foundation.results.result import without_coefficients

WEAK = Finding(
    "weak_test",
    "This test cannot rule out 2 faults that would shift a value by 2 u.",
    "rows 3-8",
    action="Repeat the first positions at the end.",
    items=({"fault": "a warm-up <of y_x>", "size": 0.0058123}, {"fault": "a tilt", "value": "DX_F"}),
)

WITHOUT_ACTION = 180
"""Places in the source that make a finding of a headline alone; none is to be added, and some go with each issue."""

WORDS = 20
"""Words of a headline, and of an action, at most."""


def test_headline_and_action_are_one_message():
    assert WEAK.message == f"{WEAK.headline} {WEAK.action}"
    assert Finding("gap", "t: 1 gap", action="look").message == "t: 1 gap: look"
    assert Finding("gap", "t: 1 gap").message == "t: 1 gap"
    assert WEAK.line == f"weak_test: {WEAK.message} (rows 3-8)"


def test_items_are_rows_of_one_table_whatever_keys_they_have():
    heads, rows = WEAK.table
    assert heads == ("fault", "size", "value")
    assert rows == [("a warm-up <of y_x>", "0.00581", ""), ("a tilt", "", "DX_F")]
    assert Finding("gap", "t: 1 gap").table == ((), [])


def test_json_there_and_back():
    data = WEAK.to_json()
    assert list(data) == ["code", "headline", "action", "items", "message", "where", "harm"]
    assert Finding.from_json(data) == WEAK
    assert len({WEAK, Finding.from_json(data)}) == 1


def test_the_message_of_an_old_result_is_its_headline():
    old = {"code": "outlier", "message": "acc_x: 1 sample; look", "where": "row 3", "harm": ["acc_x"]}
    assert Finding.from_json(old) == Finding("outlier", "acc_x: 1 sample; look", "row 3", ("acc_x",))
    del old["harm"]
    assert Finding.from_json(old).harm == ()


def test_what_harms_most_comes_first():
    none, one = Finding("gap", "none"), Finding("outlier", "one", harm=("K0_x",))
    two, all_of_it = Finding("trend", "two", harm=("K0_x", "K0_y")), Finding("trend", "all", harm=EVERYTHING)
    gross, kept = (Finding("sign_suspect", "gross", harm=harm) for harm in (("acc_x",), ()))
    asking = Finding("gap", "none", action="look")
    ordered = [gross, all_of_it, two, one, kept, asking, none]
    assert most_harmful(reversed(ordered)) == ordered


def test_other_causes_are_counted_and_named():
    found = Finding("trend", "it drifts", action="wait")
    assert with_alternatives(found, ["it drifts"]) is found
    told = with_alternatives(found, ["it is tilted", "it is bent", "it is tilted"])
    assert told.message == "it drifts (2 other causes are equally possible): wait"
    assert [item["equally possible"] for item in told.items] == ["it is tilted", "it is bent"]


@pytest.mark.parametrize(
    ("output", "more"),
    [(OutputOptions(), "--json has all"), (ReportOutput(), "--report and --json have all")],
)
def test_the_terminal_tells_three_and_counts_the_others(output, more, capsys):
    findings = [Finding("gap", f"gap {k}") for k in range(4)]
    say_findings([*findings, WEAK, Finding("outlier", "one", harm=("K0_x",))], output)
    told = capsys.readouterr().err.splitlines()
    assert told == ["outlier: one", WEAK.line, "gap: gap 0", f"3 more findings: {more}"]
    say_findings(findings, output)
    assert capsys.readouterr().err.splitlines() == [each.line for each in findings]


def test_a_page_has_headline_action_and_table():
    page = render(without_coefficients("inspect", "fine", {}, (), [WEAK]), (), "Test")
    assert f": {WEAK.headline}" in page
    assert f'<p class="action">{WEAK.action}</p>' in page
    assert "<th>size</th>" in page
    assert "<td>a warm-up &lt;of y_x&gt;</td><td>0.00581</td><td></td>" in page


def test_the_workbench_takes_the_advice_of_an_action():
    found = Finding("unmodelled_k2", "K2 shows.", action="Set imu.k2 = true.")
    assert advice_of(found, '[imu]\nmethod = "multiposition"\n', "imu") == (Advice("imu.k2", "true"),)


def calls():
    """The calls of `Finding` in the source with the function that each is in, by place."""
    for path in sorted(Path(inercal.__file__).parent.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding":
                around = [f for f in functions if f.lineno <= node.lineno <= (f.end_lineno or 0)]
                yield f"{path.parent.name}/{path.name}:{node.lineno}", node, around[-1] if around else tree


def texts(value, function, line):
    """The texts that an expression may be, each placeholder a word; a name is what it was given last before a line."""
    match value:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr():
            return ["".join(str(p.value) if isinstance(p, ast.Constant) else "x" for p in value.values)]
        case ast.IfExp():
            return [*texts(value.body, function, line), *texts(value.orelse, function, line)]
        case ast.Name():
            given = [
                node
                for node in ast.walk(function)
                if isinstance(node, ast.Assign)
                and ast.unparse(node.targets[0]) == value.id
                and node.lineno < line
            ]
            return texts(max(given, key=lambda node: node.lineno).value, function, line) if given else []
    return []


def test_findings_of_a_headline_alone_become_fewer():
    alone = [where for where, call, _ in calls() if not {"action", "items"} & {k.arg for k in call.keywords}]
    assert len(alone) <= WITHOUT_ACTION, alone


def test_headlines_and_actions_are_short():
    """At most 20 words, no semicolon, where a finding says what to do."""
    wrong, seen = [], 0
    for where, call, function in calls():
        given = {keyword.arg: keyword.value for keyword in call.keywords}
        if "action" not in given:
            continue
        for value in (call.args[1], given["action"]):
            for text in texts(value, function, call.lineno):
                seen += 1
                if ";" in text or len(text.split()) > WORDS:
                    wrong.append((where, text))
    assert seen > 10
    assert wrong == []
