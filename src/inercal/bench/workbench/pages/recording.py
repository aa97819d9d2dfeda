"""Recording: its channels over time down to single samples, findings, and the column map as a table beside its text."""

from __future__ import annotations

import asyncio
import math
import tomllib
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import events, ui

from inercal.bench.workbench.bench import Bench, Looked
from inercal.bench.workbench.charts import Notes, course_figure, spans_of
from inercal.bench.workbench.pages.form import Widget, as_toml
from inercal.bench.workbench.pages.frame import (
    PATIENCE,
    button,
    command,
    copy,
    framed,
    heading,
    picture,
    refused,
    said,
    saved,
    table,
    told,
)
from inercal.bench.workbench.pages.home import drop
from inercal.bench.workbench.sessions import MAP, STUDY, Session, put
from inercal.faces.studies.text import changed, toml, with_keys
from inercal.foundation._files import read_bytes
from inercal.foundation.errors import InercalError
from inercal.foundation.records.channels import is_channel, nearest, sensor_and_axis
from inercal.foundation.records.places import counted
from inercal.foundation.records.recognise.map_text import columns_of
from inercal.foundation.records.recognise.units import choices
from inercal.systems.listed import SYSTEMS

_NONE = ""  # the choice of a column for a channel that is not in the file


@dataclass(frozen=True)
class FileColumns:
    """The columns of one file in a map: the ``table`` they stand in, the file, those that are there, and in use."""

    table: str
    path: Path
    there: tuple[str, ...]
    columns: Mapping[str, Any]


def parts_of(
    session: Session, data: Mapping[str, Any], there: Mapping[Path, tuple[str, ...]]
) -> Iterator[FileColumns]:
    """The parts of a map, of which one is of all recordings alike, or each of a file of its own."""
    files = [part for part in data.get("file", {}).items() if isinstance(part[1], dict)]
    if not files:
        path = session.recordings[0]
        yield FileColumns("columns", path, there.get(path, ()), data.get("columns", {}))
    for number, (name, part) in enumerate(files):
        named = [path for path in session.recordings if path.name == part.get("path")]
        path = (named or session.recordings)[min(number, len(session.recordings) - 1) if not named else 0]
        yield FileColumns(f"file.{name}.columns", path, there.get(path, ()), part.get("columns", {}))


def columns_there(session: Session) -> dict[Path, tuple[str, ...]]:
    """The columns of each recording as a map writes them; none where they cannot be told."""
    found = {}
    for path in session.recordings:
        with suppress(InercalError):
            found[path] = tuple(dict.fromkeys(toml(each) for each in columns_of(path)))
    return found


class Columns:
    """The map of a session whose recordings have the columns ``there``; ``redrawn`` shows them anew after a change."""

    def __init__(
        self, session: Session, there: Mapping[Path, tuple[str, ...]], redrawn: Callable[[], Awaitable[None]]
    ) -> None:
        self.session, self.there, self.redrawn = session, there, redrawn
        heading("Columns to channels")
        self.place = ui.element("div").classes("w-full flex flex-col gap-2")
        self.fill()
        ui.label("The rest of a map is changed in its text:").classes("quiet")
        with ui.element("div").classes("w-full copies"):
            self.text = ui.textarea(value=self.written).classes("w-full command")
            self.text.props(f'outlined autogrow aria-label="text of {MAP}"')
            with ui.row().classes("items-center"):
                button(f"Save {MAP}", self.save)
                copy(f"copy {MAP}")
                saved(session, MAP)

    @property
    def written(self) -> str:
        """The map as it is."""
        return read_bytes(self.session.folder / MAP).decode(errors="replace")

    def fill(self) -> None:
        """The table of channels, a row each, and the row for one more."""
        self.place.clear()
        with self.place:
            try:
                data = tomllib.loads(self.written)
            except tomllib.TOMLDecodeError as error:
                refused(error)
                return
            for part in parts_of(self.session, data, self.there):
                rows = [
                    self.row(part, name, entry)
                    for name, entry in part.columns.items()
                    if isinstance(entry, dict) and is_channel(name)
                ]
                if part.table != "columns":
                    ui.label(part.path.name)
                table(["Channel", "From", "Unit", "Sign", "Kind", "Recognised"], rows)
                self.questions(part)
                self.more(part)

    def questions(self, part: FileColumns) -> None:
        """Questions about sensors whose unit is a guess, with the units to choose from."""
        asked: dict[str, list[str]] = {}
        for name, entry in part.columns.items():
            if isinstance(entry, dict) and entry.get("grade") == "guess":
                asked.setdefault(sensor_and_axis(name)[0], []).append(name)
        for names in asked.values():
            entry, paths = part.columns[names[0]], [f"{part.table}.{name}" for name in names]
            with ui.row().classes("items-center").props('data-question="1"'):
                ui.label(str(entry.get("question", names[0])))
                for unit in choices(str(entry.get("unit", ""))):
                    button(unit, partial(self.answer, paths, unit))

    async def answer(self, paths: Sequence[str], unit: str, grade: str = "guess") -> None:
        """Channels have the unit that was chosen, certain with a ``grade``; drawn anew for a guess, lest one types."""
        known = {"grade": '"certain"', "because": '"as answered"', "question": ""} if grade else {}
        said = known | {"unit": toml(unit)}
        await self.write({f"{path}.{key}": said[key] for path in paths for key in said})
        if grade == "guess":
            self.fill()

    def row(self, part: FileColumns, name: str, entry: Mapping[str, Any]) -> list[Any]:
        """A channel of the map."""
        path = f"{part.table}.{name}"
        taken = toml(entry.get("from"))

        async def column(chosen: str) -> None:
            kept = chosen != _NONE
            await (self.change(f"{path}.from", chosen, "value") if kept else self.write({path: ""}))
            self.fill()

        def origin() -> None:
            columns = [_NONE, *dict.fromkeys([taken, *part.there])]
            of = {each: each.strip('"') or "not in the file" for each in columns}
            ui.select(of, value=taken, on_change=lambda event: column(event.value)).props(
                f'dense aria-label="column of {name}"'
            ).classes("w-40")

        def unit() -> None:
            grade, aria = entry.get("grade", ""), f'dense aria-label="unit of {name}"'
            field = ui.input(value=entry.get("unit", "")).props(aria).classes("w-28")
            field.on("change", lambda: self.answer([path], field.value, grade))

        def sign() -> None:
            ui.select(
                {1: "+", -1: "-"}, value=entry.get("sign", 1),
                on_change=lambda event: self.change(f"{path}.sign", str(event.value), "value"),
            ).props(f'dense aria-label="sign of {name}"')  # fmt: skip

        def kind() -> None:
            ui.select(
                ["rate", "increment"], value=entry.get("kind", "rate"),
                on_change=lambda event: self.change(f"{path}.kind", event.value, "text"),
            ).props(f'dense aria-label="kind of {name}"')  # fmt: skip

        def recognised() -> None:
            ui.label(str(entry.get("grade", ""))).tooltip(str(entry.get("because", "")))

        return [name, origin, unit, sign, kind, recognised]

    def more(self, part: FileColumns) -> None:
        """One more channel, by its name, from a column that is not in use."""
        used = {toml(each.get("from")) for each in part.columns.values() if isinstance(each, dict)}
        left = [each for each in part.there if each not in used]
        if not left:
            return
        with ui.row().classes("items-center"):
            name = ui.input("One more channel", placeholder="temperature").props("dense").classes("w-40")
            column = ui.select({each: each.strip('"') for each in left}, label="From", value=left[0])
            column.props("dense").classes("w-40")
            unit = ui.input("Unit", placeholder="degC").props("dense").classes("w-28")
            button("Add", partial(self.add, part, name, column, unit))

    async def add(self, part: FileColumns, name: ui.input, column: ui.select, unit: ui.input) -> None:
        """Add a channel."""
        given = (name.value or "").strip()
        if not is_channel(given):
            ui.notify(f"{given or 'no name'} is no channel: {nearest(given)}", type="negative")
            return
        path = f"{part.table}.{given}"
        keys = {f"{path}.from": str(column.value)}
        if unit.value:
            keys[f"{path}.unit"] = as_toml(unit.value, "text")
        await self.write(keys)
        self.fill()

    async def change(self, path: str, value: str, widget: Widget) -> None:
        """One key of the map is changed."""
        with told():
            await self.keep(changed(self.written, path, as_toml(value, widget)))

    async def write(self, keys: Mapping[str, str]) -> None:
        """Keys of the map are set to their TOML, or taken out where that is empty."""
        with told():
            await self.keep(with_keys(self.written, keys))

    async def save(self) -> None:
        """The text of the map is taken as it was typed."""
        with told():
            tomllib.loads(self.text.value)
            await self.keep(self.text.value)
            self.fill()

    async def keep(self, text: str) -> None:
        """Write the map, and have the recording shown by it."""
        put(self.session, MAP, text)
        self.text.set_value(text)
        await self.redrawn()


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
    plot = picture(course_figure(shown, span, notes), "channels over time")
    if notes.rests:
        ui.label(
            f"{len(notes.rests)} rests are shaded green, turns between them red. Drag to zoom, double-click for all."
        ).classes("quiet text-sm")

    def zoomed(event: events.GenericEventArguments) -> None:
        moved, told = span_of(event.args)
        if moved:
            plot.update_figure(course_figure(shown, told, notes))

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
