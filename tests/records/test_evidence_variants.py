"""What each table holds is found, what it does not hold is not, and what it does not say is asked."""

import tomllib

import pytest
from evidence_variants import FIRST_HALF, SECOND_HALF, VARIANTS

from inercal.foundation.records.recognise.map_text import guess_map


def flaw(name, folder):
    """What is otherwise recognised than it is, empty where nothing is."""
    text, how, wanted, asked = VARIANTS[name]
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    columns = tomllib.loads(guess_map(path, **how)).get("columns", {})
    found = {channel: entry["from"] for channel, entry in columns.items()}
    questions = {entry["question"] for entry in columns.values() if "question" in entry}
    missed = {channel: title for channel, title in wanted.items() if found.get(channel) != title}
    axes = {channel.rpartition("_")[0] for channel in wanted}
    invented = {
        channel for channel in found if channel not in wanted and channel.rpartition("_")[0] not in axes
    }
    words = [f"missed {missed} of {found}"] if missed else []
    words += [f"invented {invented}"] if invented else []
    return words + ([f"asked {sorted(questions)}"] if len(questions) != asked else [])


@pytest.mark.parametrize("name", [*FIRST_HALF, *SECOND_HALF])
def test_what_a_table_holds_is_recognised(name, tmp_path):
    assert flaw(name, tmp_path) == []
