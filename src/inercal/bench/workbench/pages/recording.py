"""Recording: what is in the files, columns to channels, all channels over time down to single samples."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

from nicegui import events, ui

from inercal.bench.workbench.bench import Bench, Looked
from inercal.bench.workbench.charts import Notes, figure
from inercal.bench.workbench.pages.columns import Columns, columns_there
from inercal.bench.workbench.pages.frame import (
    PATIENCE,
    button,
    command,
    framed,
    heading,
    picture,
    refused,
    said,
    table,
    told,
)
from inercal.bench.workbench.pages.home import drop
from inercal.bench.workbench.residuals import spans_of
from inercal.bench.workbench.sessions import MAP, STUDY, Session
from inercal.foundation.errors import InercalError
from inercal.foundation.records.places import counted
from inercal.systems.listed import SYSTEMS


def add(bench: Bench) -> None:
    """Add the page."""

    @ui.page("/sessions/{number}/recording", response_timeout=PATIENCE)
    async def recording(number: str, new: str = "", begin: float = math.nan, end: float = math.nan) -> None:
        session = bench.sessions.get(number)
        begun: BaseException | None = None
        if new and session.study is None and session.recordings:
            try:
                session = await asyncio.to_thread(bench.begin_study, session)
            except InercalError as error:
                begun = error
        with framed("Recording", session, "recording"):
            names = ", ".join(path.name for path in session.recordings) or "none yet"
            ui.label(f"Session {session.id}, {session.title}; recordings: {names}").classes("quiet")
            if not session.recordings:
                drop()
                return
            if begun is not None:
                refused(begun)
            _kind(bench, session)
            with ui.element("div").classes("w-full") as place:
                ui.spinner()
            await ui.context.client.connected()
            span = (begin, end) if begin < end else None
            redrawn = partial(_look, bench, session, place, span)
            await redrawn()
            if session.map is not None:
                Columns(session, await asyncio.to_thread(columns_there, session), redrawn)
            else:
                button("Choose the columns by hand", partial(_map, bench, session))
            heading("The same from the command line")
            words = " ".join(path.name for path in session.recordings)
            mapped = f" --map {MAP}" if session.map is not None else ""
            command(f"inercal new {session.kind} {words} --out {STUDY}")
            command(f"inercal inspect {words}{mapped} --report recording.html")
            drop()


async def _map(bench: Bench, session: Session) -> None:
    """Begin a map, of recordings whose headers already say what they hold."""
    with told():
        await asyncio.to_thread(bench.begin_map, session)
        ui.navigate.reload()


def _kind(bench: Bench, session: Session) -> None:
    """The kind of test that was recorded, to choose."""

    async def begin(kind: str) -> None:
        with told():
            await asyncio.to_thread(bench.begin_study, session, kind)
            ui.navigate.reload()

    async def choose(event: events.ValueChangeEventArguments[str]) -> None:
        if session.study is None:
            await begin(event.value)
            return
        with ui.dialog() as dialog, ui.card():
            ui.label("A new study, and a map where one is needed, take the place of those there.")
            with ui.row():
                button("Begin anew", lambda: begin(event.value), main=True)
                button("Leave them", ui.navigate.reload)
        dialog.open()

    ui.select(
        {kind: system.title for kind, system in SYSTEMS.items()},
        value=session.kind,
        label="The recording is of",
        on_change=choose,
    ).classes("w-96 max-w-full")


async def _look(bench: Bench, session: Session, place: ui.element, span: tuple[float, float] | None) -> None:
    """Channels, findings and pictures of the recording, over a ``span`` of time [s] or the whole; of repeat runs those
    of the one that is chosen."""
    try:
        runs = await asyncio.to_thread(bench.look, session)
        found = await asyncio.to_thread(_rests, bench, session)
    except InercalError as error:
        place.clear()
        with place:
            refused(error)
        return
    place.clear()
    with place:
        if len(runs) > 1:
            names = {k: f"run {k + 1}: {looked.files}" for k, looked in enumerate(runs)}
            ui.select(
                names, value=0, label=f"{len(runs)} runs", on_change=lambda event: show(runs[event.value])
            ).classes("w-96 max-w-full")
        inner = ui.element("div").classes("w-full")

    def show(looked: Looked) -> None:
        inner.clear()
        with inner:
            _one(looked, found if len(runs) == 1 else (), span)

    show(runs[0])


def _one(looked: Looked, rests: Sequence[tuple[float, float]], span: tuple[float, float] | None) -> None:
    """One run: what was found, its pictures and numbers; ``rests`` as a result took them, if there is one."""
    findings = looked.record.findings
    ui.label(
        "Nothing suspicious was found." if not findings else f"{counted(len(findings), 'finding')}:"
    ).props('data-findings="1"')
    for finding in findings[:20]:
        said(finding)
    _pictures(looked, replace(looked.notes, rests=rests) if rests else looked.notes, span)
    _channels(looked)


def _rests(bench: Bench, session: Session) -> tuple[tuple[float, float], ...]:
    """Rests as the last calibration took them; empty without one."""
    job = bench.last_job(session)
    if job is None or job.result is None:
        return ()
    with suppress(InercalError):
        return spans_of(bench.result(job).estimate.result)
    return ()


def _pictures(looked: Looked, notes: Notes, span: tuple[float, float] | None) -> None:
    """All channels over time; what one zooms to is drawn anew."""
    shown = looked.courses
    plot = picture(figure(shown, span, notes), "channels over time")
    if notes.rests:
        ui.label(
            f"{len(notes.rests)} rests are shaded green, turns between them red. Drag to zoom, double-click for all."
        ).classes("quiet text-sm")

    def zoomed(event: events.GenericEventArguments) -> None:
        moved, told = span_of(event.args)
        if moved:
            plot.update_figure(figure(shown, told, notes))

    plot.on("plotly_relayout", zoomed)


def span_of(told: object) -> tuple[bool, tuple[float, float] | None]:
    """A change of the times of a picture that plotly tells, and the new ones: None for all of them."""
    if not isinstance(told, dict):
        return False, None
    if told.get("xaxis.autorange"):
        return True, None
    both = told.get("xaxis.range", [told.get("xaxis.range[0]"), told.get("xaxis.range[1]")])
    try:
        begin, end = map(float, both)
    except (TypeError, ValueError):
        return False, None
    return begin < end, (begin, end)


def _channels(looked: Looked) -> None:
    """The channels in numbers."""
    from inercal.faces.report.inspection import summary

    rows = [
        [each.name, each.unit, f"{each.samples}", f"{each.missing}", f"{each.mean:.6g}", f"{each.deviation:.4g}",
         f"{each.minimum:.6g}", f"{each.maximum:.6g}"]
        for each in summary(looked.record)
    ]  # fmt: skip
    head = ["Channel", "Unit", "Rows", "Missing", "Mean", "Deviation", "Least", "Greatest"]
    table(head, rows, {2, 3, 4, 5, 6, 7})
