"""``inercal keep``, ``instruments``, ``results``, ``show``, ``supersede`` and ``rerun``: what is in a store."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT
from inercal.cli.options import InstrumentOption, OutputOptions, ReportOutput, StoreOption, working
from inercal.cli.outcome import emit, say_findings
from inercal.foundation.errors import InercalError, InputError
from inercal.foundation.results.shown import aligned

if TYPE_CHECKING:
    import subprocess

Identity = Annotated[
    str, Parameter(help="The result, by the first digits of its identity (`inercal results`).")
]


def keep(
    result: Annotated[Path, Parameter(help="Result that a command wrote to --out (.json or .toml).")],
    /,
    *,
    instrument: InstrumentOption = None,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
    report: Annotated[Path | None, Parameter(help="Its report, kept beside it.")] = None,
) -> None:
    """Keep a result that was made elsewhere."""
    from inercal.foundation._files import read_bytes
    from inercal.foundation.records.read import source_of
    from inercal.foundation.results.files import load
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.keep import item_of, saved_in
    from inercal.laboratory.keep import keep as kept
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    estimate = load(result)
    try:
        page = None if report is None else read_bytes(report)
    except OSError as error:
        raise InputError(
            report, f"cannot be read ({error.strerror}), expected the report of the result"
        ) from error
    done = kept(opened, estimate, item_of(estimate, instrument), page, saved_in(result, estimate))
    for note in done.notes:
        output.say(note)
    words = f"{done.id[:SHORT]} {'kept' if done.new else 'was kept before, nothing added'} in {opened.where}"
    data = {"id": done.id, "new": done.new, "store": opened.where, "notes": list(done.notes)}
    emit(without_coefficients("keep", words, data, (source_of(result),)), words, output)


def instruments(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> None:  # noqa: B008  (frozen)
    """List the instruments of a store."""
    from inercal.foundation.records.places import counted
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.catalog import instruments as listed
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    rows = listed(opened)
    words = f"{counted(len(rows), 'instrument')} in {opened.where}"
    head = ("maker", "model", "serial", "owner", "results", "last")
    table = [head, *((*(str(row[key]) for key in head[:5]), (row["last"] or "")[:10]) for row in rows)]
    text = "\n".join([*(aligned(table, range(6)) if rows else ()), words])
    emit(without_coefficients("instruments", words, {"instruments": rows}), text, output)


def results(
    *,
    instrument: InstrumentOption = None,
    since: Annotated[str | None, Parameter(help='First day, such as "2026-01-31".')] = None,
    status: Annotated[str | None, Parameter(help='Only results of this status, such as "ok".')] = None,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
) -> None:
    """List the results of a store."""
    from datetime import date

    from inercal.foundation.findings import Status
    from inercal.foundation.records.places import counted
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.catalog import results as listed
    from inercal.laboratory.store import open_store

    if status is not None and status not in [each.value for each in Status]:
        raise InputError("--status", f"found {status!r}, expected {', '.join(each.value for each in Status)}")
    try:
        day = None if since is None else date.fromisoformat(since).isoformat()
    except ValueError as error:
        raise InputError("--since", f"found {since!r}, expected a day such as 2026-01-31") from error
    opened = open_store(store)
    found = listed(opened, instrument, day, status)
    words = f"{counted(len(found), 'result')} in {opened.where}"
    table = [("result", "date", "command", "instrument", "status", "")]
    for each in found:
        after = f"superseded by {each.superseded_by[:SHORT]}" if each.superseded_by else ""
        table.append(
            (each.id[:SHORT], each.date, each.command, str(each.instrument or ""), each.status, after)
        )
    rows = [
        {**vars(each), "instrument": None if each.instrument is None else vars(each.instrument)}
        for each in found
    ]
    text = "\n".join([*(aligned(table, range(6)) if found else ()), words])
    emit(without_coefficients("results", words, {"results": rows}), text, output)


def show(
    identity: Identity,
    /,
    *,
    store: StoreOption = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> None:
    """Show a result of a store."""
    from inercal.foundation._files import write_bytes
    from inercal.foundation.results.files import save
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.catalog import show as shown
    from inercal.laboratory.store import open_store

    output.check((".json", ".toml"))
    opened = open_store(store)
    found = shown(opened, identity)
    listed = found.listed
    if output.report is not None:
        if found.report is None:
            raise InputError(
                listed.id[:SHORT], "was kept without a report, expected one that was kept with it"
            )
        write_bytes(output.report, opened.objects.read(found.report))
    if output.out is not None:
        save(found.estimate, output.out)
    say_findings(found.estimate.findings, output)
    for what, path in (("result", output.out), ("report", output.report)):
        if path is not None:
            output.say(f"{what}: {path}")
    facts = [("result", listed.id), ("command", listed.command), ("instrument", str(listed.instrument or ""))]
    facts += [("measured", listed.measured), ("kept", listed.made), ("operator", listed.operator)]
    facts += [("inercal", listed.version), ("sources", found.program)]
    facts += [
        ("file", f"{path} ({sha256[:SHORT]})" + (f", at {at}" if at else ""))
        for path, sha256, at in found.files
    ]
    facts += [("equipment", text) for text in found.references]
    facts += [("certificate", number) for number in found.certificates]
    if listed.superseded_by:
        facts.append(("superseded by", f"{listed.superseded_by[:SHORT]}: {found.reason}"))
    lines = [f"{name:13s}  {text}" for name, text in facts if text]
    table = found.estimate.shown().table() if found.estimate.names else ""
    text = "\n".join([*lines, "", *([table, ""] if table else ()), f"{listed.status}: {listed.message}"])
    emit(found.estimate, text, output)


def supersede(
    identity: Identity,
    by: Annotated[str, Parameter(help="The result that takes its place.")],
    /,
    *,
    reason: Annotated[str, Parameter(help="Why, in words.")],
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
) -> None:
    """Say that a result takes the place of another."""
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.issue import supersede as superseded
    from inercal.laboratory.store import open_store

    old, new = superseded(open_store(store), identity, by, reason)
    words = f"{old[:SHORT]} is superseded by {new[:SHORT]}: {reason}"
    emit(
        without_coefficients("supersede", words, {"result": old, "by": new, "reason": reason}), words, output
    )


def rerun(
    identity: Identity,
    /,
    *,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
) -> int:
    """Make a kept result once more, and set the new one beside it."""
    import json
    import tempfile

    from inercal.cli.stored_line import stored_line
    from inercal.foundation.results.files import from_json
    from inercal.foundation.results.result import without_coefficients
    from inercal.foundation.results.shown import rounded
    from inercal.laboratory.again import beside, laid_out, verdict
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.catalog import show as shown
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    found = shown(opened, identity)
    short = found.listed.id[:SHORT]
    try:
        line = stored_line(found.estimate.provenance.get("arguments", ()))
        with tempfile.TemporaryDirectory(prefix="inercal-") as folder, working(output) as progress:
            laid = laid_out(opened, found, Path(folder))
            arguments = line.words(laid)
            progress(f"inercal {' '.join(arguments)}")
            ended = _made_again(arguments, laid.folder)
    except InputError as error:
        raise InputError(f"{short}: {error.where}", error.message) from error
    if ended.returncode not in (0, EXIT_BAD_VERDICT):
        raise InercalError(f"{short} made once more: {ended.stderr.strip()[-600:]}")
    new = from_json(json.loads(ended.stdout))
    rows = beside(found.estimate, new)
    sound, words = verdict(found.estimate, new)
    table = [("", "kept", "now", "u", "unit", "")]
    for row in rows:
        old, now = (rounded(value, row.u)[0] for value in (row.old, row.new))
        table.append((row.name, old, now, rounded(row.u, row.u)[0], row.unit, row.same))
    text = "\n".join([*(aligned(table, range(6)) if rows else ()), words])
    data = {"id": found.listed.id, "sound": sound, "coefficients": [vars(row) for row in rows]}
    emit(without_coefficients("rerun", words, data), text, output)
    return 0 if sound else EXIT_BAD_VERDICT


def _made_again(arguments: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """The command in a process that has no store, and imports nothing from the folder, whose files are anybody's."""
    import os
    import subprocess
    import sys

    own = {name: text for name, text in os.environ.items() if not name.startswith("INERCAL_")}
    own["PYTHONPATH"] = os.pathsep.join(os.path.abspath(each) for each in sys.path if each)
    command = [sys.executable, "-P", "-m", "inercal", *arguments]
    return subprocess.run(
        command, cwd=folder, env=own, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
