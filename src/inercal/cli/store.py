"""``inercal store``: the store of a laboratory made, brought up to date, checked, carried elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT
from inercal.cli.options import OutputOptions, StoreOption, reading
from inercal.cli.outcome import emit


def store_init(
    *,
    store: StoreOption = None,
    objects: Annotated[
        str | None, Parameter(help="Folder or URL of the objects; a database needs it, a folder has its own.")
    ] = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
) -> None:
    """Make an empty store."""
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.store import make_store

    made = make_store(store, objects)
    words = f"a store is made: {made.where}, its objects in {made.objects.where}"
    emit(
        without_coefficients("store init", words, {"store": made.where, "objects": made.objects.where}),
        words,
        output,
    )


def store_upgrade(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> None:  # noqa: B008  (frozen)
    """Bring a store to the version of this inercal."""
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.store import upgrade_store

    opened, before, after = upgrade_store(store)
    words = f"{opened.where} is of version {after}" + (
        "" if before == after else f", was of version {before}"
    )
    result = {"store": opened.where, "before": before, "after": after}
    emit(without_coefficients("store upgrade", words, result), words, output)


def store_check(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> int:  # noqa: B008  (frozen)
    """Check chain, rows, objects and foreign keys of a store."""
    from inercal.foundation.records.places import counted
    from inercal.foundation.results.result import without_coefficients
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
    emit(without_coefficients("store check", words, vars(found)), text, output)
    return EXIT_BAD_VERDICT if found.faults else 0


def store_scrub(*, store: StoreOption = None, output: OutputOptions = OutputOptions()) -> None:  # noqa: B008  (frozen)
    """Take secrets of addresses out of a store of inercal 0.2.0 or earlier."""
    from inercal.foundation.records.places import counted
    from inercal.foundation.results.result import without_coefficients
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
    emit(without_coefficients("store scrub", words, vars(done)), words, output)


def store_export(
    folder: Annotated[Path, Parameter(help="A new or empty folder.")],
    /,
    *,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
) -> None:
    """Copy a store into a folder, which is a store itself."""
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.carry import export_store
    from inercal.laboratory.store import open_store

    with reading(output, "copying") as progress:
        made = export_store(open_store(store), folder, progress)
    words = f"copied to {made.where}"
    emit(without_coefficients("store export", words, {"store": made.where}), words, output)


def store_import(
    folder: Annotated[Path, Parameter(help="The folder of a store, as `inercal store export` writes it.")],
    /,
    *,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
) -> None:
    """Add the results of another store."""
    from inercal.foundation.records.places import counted
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.carry import import_store
    from inercal.laboratory.store import open_store

    opened = open_store(store)
    with reading(output, "copying") as progress:
        added = import_store(opened, folder, progress)
    parts = [counted(added.results, "result"), counted(added.supersessions, "supersession")]
    parts.append(counted(added.certificates, "certificate"))
    words = f"{', '.join(parts)} added to {opened.where}, {added.there} there already"
    emit(without_coefficients("store import", words, vars(added)), words, output)
