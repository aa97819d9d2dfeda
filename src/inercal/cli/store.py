"""The store of a laboratory: ``inercal store``, and the commands on what is in it, from ``keep`` to ``rerun``."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT
from inercal.cli.options import InstrumentOption, OutputOptions, ReportOutput, StoreOption, reading, working
from inercal.cli.outcome import WHOLE, emit, hand_over, say_findings, tell
from inercal.foundation.errors import InercalError, InputError
from inercal.foundation.results.shown import aligned

if TYPE_CHECKING:
    import subprocess


def store_init(
    *,
    store: StoreOption = None,
    objects: Annotated[
        str | None, Parameter(help="Folder or URL of the objects; a database needs it, a folder has its own.")
    ] = None,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Make an empty store."""
    from inercal.laboratory.store import make_store

    made = make_store(store, objects)
    words = f"a store is made: {made.where}, its objects in {made.objects.where}"
    tell(output, "store init", words, {"store": made.where, "objects": made.objects.where})


def store_upgrade(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> None:
    """Bring a store to the version of this inercal."""
    from inercal.laboratory.store import upgrade_store

    opened, before, after = upgrade_store(store)
    words = f"{opened.where} is of version {after}" + (
        "" if before == after else f", was of version {before}"
    )
    result = {"store": opened.where, "before": before, "after": after}
    tell(output, "store upgrade", words, result)


def store_check(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> int:
    """Check chain, rows, objects and foreign keys of a store."""
    from inercal.foundation.records.places import counted
    from inercal.laboratory.check import check
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    with reading(output, "checking") as progress:
        found = check(opened, progress)
    for note in found.notes:
        output.say(note)
    what = ((found.events, "event"), (found.results, "result"), (found.objects, "object"))
    sound = f"{', '.join(counted(many, name) for many, name in what)} as they were written"
    words = counted(len(found.faults), "fault") if found.faults else sound
    text = "\n".join([*found.faults, f"{words}; head of the chain: {found.head}"])
    tell(output, "store check", words, vars(found), text=text)
    return EXIT_BAD_VERDICT if found.faults else 0


def store_scrub(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> None:
    """Take secrets of addresses out of a store of inercal 0.2.0 or earlier."""
    from inercal.foundation.records.places import counted
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.scrub import scrub
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    done = scrub(opened)
    for sha256 in done.files:
        output.say(f"file {sha256[:SHORT]}: holds a secret and stays, for results rest on it")
    freed = [
        counted(len(done.subjects["keep"]), "result"),
        counted(len(done.subjects["certificate"]), "certificate"),
    ]
    words = (
        f"{' and '.join(freed)} freed of secrets, head of the chain before: {done.before}, now: {done.head}; change "
        "the passwords, for what was handed out or copied before holds them still"
        if done.objects or done.texts
        else f"no secret found in {opened.where}"
    )
    tell(output, "store scrub", words, vars(done))


def store_export(
    folder: Annotated[Path, Parameter(help="A new or empty folder.")],
    /,
    *,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Copy a store into a folder, which is a store itself."""
    from inercal.laboratory.carry import export_store
    from inercal.laboratory.store import open_store

    with reading(output, "copying") as progress:
        made = export_store(open_store(store), folder, progress)
    words = f"copied to {made.where}"
    tell(output, "store export", words, {"store": made.where})


def store_import(
    folder: Annotated[Path, Parameter(help="The folder of a store, as `inercal store export` writes it.")],
    /,
    *,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Add the results of another store."""
    from inercal.foundation.records.places import counted
    from inercal.laboratory.carry import import_store
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    with reading(output, "copying") as progress:
        added = import_store(opened, folder, progress)
    parts = [counted(added.results, "result"), counted(added.supersessions, "supersession")]
    parts.append(counted(added.certificates, "certificate"))
    words = f"{', '.join(parts)} added to {opened.where}, {added.there} there already"
    tell(output, "store import", words, vars(added))


Identity = Annotated[
    str, Parameter(help="The result, by the first digits of its identity (`inercal results`).")
]


def _day(option: str, text: str) -> date:
    """The day that an option states; raises `InputError`."""
    try:
        return date.fromisoformat(text)
    except ValueError as error:
        raise InputError(option, f"found {text!r}, expected a day such as 2026-01-31") from error


def keep(
    result: Annotated[Path, Parameter(help="Result that a command wrote to --out (.json or .toml).")],
    /,
    *,
    instrument: InstrumentOption = None,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),
    report: Annotated[Path | None, Parameter(help="Its report, kept beside it.")] = None,
) -> None:
    """Keep a result that was made elsewhere."""
    from inercal.foundation._files import input_bytes
    from inercal.foundation.records.read import source_of
    from inercal.foundation.results.files import load
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.keep import item_of, saved_in
    from inercal.laboratory.keep import keep as kept
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    estimate = load(result)
    page = None if report is None else input_bytes(report, "the report of the result")
    done = kept(opened, estimate, item_of(estimate, instrument), page, saved_in(result, estimate))
    for note in done.notes:
        output.say(note)
    words = f"{done.id[:SHORT]} {'kept' if done.new else 'was kept before, nothing added'} in {opened.where}"
    data = {"id": done.id, "new": done.new, "store": opened.where, "notes": list(done.notes)}
    tell(output, "keep", words, data, (source_of(result),))


def instruments(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> None:
    """List the instruments of a store."""
    from inercal.foundation.records.places import counted
    from inercal.laboratory.catalog import instruments as listed
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    rows = listed(opened)
    words = f"{counted(len(rows), 'instrument')} in {opened.where}"
    head = ("maker", "model", "serial", "owner", "results", "last")
    table = [head, *((*(str(row[key]) for key in head[:5]), (row["last"] or "")[:10]) for row in rows)]
    text = "\n".join([*(aligned(table, range(6)) if rows else ()), words])
    tell(output, "instruments", words, {"instruments": rows}, text=text)


def results(
    *,
    instrument: InstrumentOption = None,
    since: Annotated[str | None, Parameter(help='First day, such as "2026-01-31".')] = None,
    status: Annotated[str | None, Parameter(help='Only results of this status, such as "ok".')] = None,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),
) -> None:
    """List the results of a store."""
    from inercal.foundation.findings import Status
    from inercal.foundation.records.places import counted
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.catalog import results as listed
    from inercal.laboratory.store import open_store

    if status is not None and status not in [each.value for each in Status]:
        raise InputError("--status", f"found {status!r}, expected {', '.join(each.value for each in Status)}")
    day = None if since is None else _day("--since", since).isoformat()
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
    tell(output, "results", words, {"results": rows}, text=text)


def show(
    identity: Identity,
    /,
    *,
    store: StoreOption = None,
    output: ReportOutput = ReportOutput(),
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
    output: OutputOptions = OutputOptions(),
) -> None:
    """Say that a result takes the place of another."""
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.catalog import supersede as superseded
    from inercal.laboratory.store import open_store

    old, new = superseded(open_store(store), identity, by, reason)
    words = f"{old[:SHORT]} is superseded by {new[:SHORT]}: {reason}"
    tell(output, "supersede", words, {"result": old, "by": new, "reason": reason})


def rerun(
    identity: Identity,
    /,
    *,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),
) -> int:
    """Make a kept result once more, and set the new one beside it."""
    import json
    import tempfile

    from inercal.cli.stored_line import stored_line
    from inercal.foundation.results.files import from_json
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
    tell(output, "rerun", words, data, text=text)
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


def history(
    of: Annotated[
        list[str],
        Parameter(help="Serial number of an instrument in the store, or results of one instrument."),
    ],
    /,
    *,
    coefficient: Annotated[
        list[str] | None, Parameter(help="Only this coefficient, or group such as K1. May be repeated.")
    ] = None,
    tolerance: Annotated[
        Path | None,
        Parameter(help="File (TOML) with the table [specification]; that of the last study if absent."),
    ] = None,
    until: Annotated[
        str | None,
        Parameter(help='Date to predict for, such as "2027-01-31"; a year after the last if absent.'),
    ] = None,
    store: StoreOption = None,
    output: ReportOutput = ReportOutput(),
) -> int:
    """Follow the coefficients of an instrument from calibration to calibration."""
    from inercal.foundation._files import write_text
    from inercal.laboratory.history_page import rows_csv
    from inercal.laboratory.verbs import history as history_of
    from inercal.laboratory.verbs import specification_in

    day = None if until is None else _day("--until", until)
    files = [Path(each) for each in of if Path(each).is_file()]
    output.check((*WHOLE, ".csv"), (tolerance, *files))
    limits = None if tolerance is None else specification_in(tolerance)
    result = history_of(*of, coefficients=coefficient, tolerance=limits, at=day, store=store)

    def curves(path: Path) -> None:
        write_text(path, rows_csv(result.evidence))

    return hand_over(result.estimate, result.view.tables(), result.view.page, output, "history", curves)
