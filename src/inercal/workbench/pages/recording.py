"""Recording: what is in the files, columns to channels, all channels over time down to single samples."""

from __future__ import annotations

import asyncio
import math
import tomllib
from contextlib import suppress
from dataclasses import replace
from typing import Any

from nicegui import events, ui

from inercal._files import read_bytes
from inercal.errors import InercalError
from inercal.records.channels import is_channel
from inercal.workbench.bench import KINDS, Bench, Looked
from inercal.workbench.charts import Notes, figure
from inercal.workbench.form import Widget, as_toml, changed
from inercal.workbench.pages.frame import PATIENCE, button, command, framed, heading, refused, table, told
from inercal.workbench.pages.home import drop
from inercal.workbench.residuals import spans_of
from inercal.workbench.sessions import MAP, STUDY, Session, put


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
            await _look(bench, session, place, (begin, end) if begin < end else None)
            if session.map is not None:
                heading("Columns to channels")
                _map(session)
            heading("The same from the command line")
            words = " ".join(path.name for path in session.recordings)
            mapped = f" --map {MAP}" if session.map is not None else ""
            command(f"inercal new {session.kind} {words} --out {STUDY}")
            command(f"inercal inspect {words}{mapped} --report recording.html")
            drop()


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

    ui.select(dict(KINDS), value=session.kind, label="The recording is of", on_change=choose).classes(
        "w-96 max-w-full"
    )


async def _look(bench: Bench, session: Session, place: ui.element, span: tuple[float, float] | None) -> None:
    """Channels, findings and pictures of the recording, over a ``span`` of time [s] or the whole."""
    try:
        looked = await asyncio.to_thread(bench.look, session)
        found = await asyncio.to_thread(_rests, bench, session)
    except InercalError as error:
        place.clear()
        with place:
            refused(error)
        return
    place.clear()
    with place:
        findings = looked.record.findings
        ui.label("Nothing suspicious was found." if not findings else f"{len(findings)} findings:").props(
            'data-findings="1"'
        )
        for finding in findings[:20]:
            where = f" ({finding.where})" if finding.where else ""
            ui.label(f"{finding.code}: {finding.message}{where}").classes("doubt")
        _pictures(looked, replace(looked.notes, rests=found) if found else looked.notes, span)
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
    plot = ui.plotly(figure(shown, span, notes)).classes("w-full")
    plot.props('aria-label="channels over time" role="group"')
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
    from inercal.report.inspection import summary

    rows = [
        [each.name, each.unit, f"{each.samples}", f"{each.missing}", f"{each.mean:.6g}", f"{each.deviation:.4g}",
         f"{each.minimum:.6g}", f"{each.maximum:.6g}"]
        for each in summary(looked.record)
    ]  # fmt: skip
    head = ["Channel", "Unit", "Rows", "Missing", "Mean", "Deviation", "Least", "Greatest"]
    table(head, rows, {2, 3, 4, 5, 6, 7})


def _map(session: Session) -> None:
    """The columns of the map, each with its channel, unit, sign and kind, to change."""
    text = read_bytes(session.folder / MAP).decode(errors="replace")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        refused(error)
        return
    parts = [("columns", data.get("columns", {}))]
    files = data.get("file", {})
    parts += [
        (f"file.{name}.columns", part["columns"]) for name, part in files.items() if isinstance(part, dict)
    ]

    def change(path: str, value: str, widget: Widget) -> None:
        with told():
            now = read_bytes(session.folder / MAP).decode()
            put(session, MAP, changed(now, path, as_toml(value, widget)))
            ui.navigate.reload()

    rows = []
    for where, columns in parts:
        for name, entry in columns.items():
            if isinstance(entry, dict) and is_channel(name):
                rows.append(_row(f"{where}.{name}", name, entry, change))
    table(["Channel", "From", "Unit", "Sign", "Kind"], rows)
    ui.label("What else a map can say is changed in its text:").classes("quiet")
    _text(session, MAP, text)


def _row(path: str, name: str, entry: dict[str, Any], change: Any) -> list[Any]:
    """A channel of the map."""

    def unit() -> None:
        field = (
            ui.input(value=str(entry.get("unit", "")))
            .props(f'dense aria-label="unit of {name}"')
            .classes("w-28")
        )
        field.on("change", lambda: change(f"{path}.unit", field.value, "text"))

    def sign() -> None:
        ui.select(
            {1: "+", -1: "-"}, value=entry.get("sign", 1),
            on_change=lambda event: change(f"{path}.sign", str(event.value), "value"),
        ).props(f'dense aria-label="sign of {name}"')  # fmt: skip

    def kind() -> None:
        ui.select(
            ["rate", "increment"], value=entry.get("kind", "rate"),
            on_change=lambda event: change(f"{path}.kind", event.value, "text"),
        ).props(f'dense aria-label="kind of {name}"')  # fmt: skip

    return [name, str(entry.get("from", "")), unit, sign, kind]


def _text(session: Session, name: str, text: str) -> None:
    """A file of the session as text, to change."""
    editor = (
        ui.textarea(value=text)
        .props(f'outlined autogrow aria-label="text of {name}"')
        .classes("w-full command")
    )

    def save() -> None:
        with told():
            tomllib.loads(editor.value)
            put(session, name, editor.value)
            ui.navigate.reload()

    button(f"Save {name}", save)
