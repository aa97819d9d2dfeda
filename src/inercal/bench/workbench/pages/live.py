"""Live: an instrument by wire: source, channels, rest, angle or coefficients with their band, alarms, recording.

The page only looks; the measurement goes on without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from nicegui import ui

from inercal.bench.live.address import SINKS, SOURCES
from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.live_status import KEPT, drawable, row_figure, rows, status, words_of
from inercal.bench.workbench.measurements import (
    MEASURED,
    Wish,
    WishedMeasurement,
    begun_with,
    interval_of,
    next_name,
    recordings,
)
from inercal.bench.workbench.pages.frame import button, command, framed, heading, table, told
from inercal.bench.workbench.sessions import Session
from inercal.systems.listed import SYSTEMS

_EVERY = 0.5
"""Time [s] between two looks at a measurement."""

_ALARMS = 12
"""Messages that are shown, the newest first."""


def add(bench: Bench) -> None:
    """Add the pages: of one session, and of all that is measured."""

    @ui.page("/sessions/{number}/live")
    def show(number: str) -> None:
        session = bench.sessions.get(number)
        with framed("Live measurement", session, "live"):
            if session.study is None:
                ui.label("There is no study yet, which would say what is measured.")
                ui.link("Begin one", f"/sessions/{session.id}/study")
                return
            _Desk(bench, session)

    @ui.page("/live")
    def at_work() -> None:
        def begin(kind: str) -> None:
            with told():
                session = bench.by_wire(kind)
                ui.navigate.to(f"/sessions/{session.id}/study")

        with framed("Live"):
            heading("At work")
            going_on = bench.measurements.at_work
            if not going_on:
                ui.label("Nothing is measured now.")
            for number, live in going_on.items():
                ui.link(f"Session {number}: {live.command}", f"/sessions/{number}/live")
            heading("Measure an instrument by wire")
            ui.label(
                "A study says what is measured; a column map says what its rows or frames hold, and is dropped on the "
                "page beside it. Then its step Live."
            ).classes("quiet")
            with ui.row():
                for kind, what in MEASURED.items():
                    title = SYSTEMS[kind].title
                    button(f"{title}: {what}", partial(begin, kind), label=f"measure: {title}")


class _Desk:
    """The measurement of a session: begun, followed and stopped."""

    def __init__(self, bench: Bench, session: Session) -> None:
        self.bench, self.session = bench, session
        self.state = ui.label().classes("verdict").props('role="status" data-live="1"')
        self.failure = ui.label().classes("bad").props('role="alert"')
        self._source()
        with ui.element("div").classes("w-full"):
            self.same = ui.element("div").classes("w-full")
            with ui.row():
                self.start = button("Start", self.begin, main=True)
                self.end = button("Stop", self.stop)
        self.seen = ui.element("div").classes("w-full")
        self.files = ui.element("div").classes("w-full")
        self.shown: WishedMeasurement | None = None
        self.view: _View | None = None
        self.look()
        ui.timer(_EVERY, self.look)

    def _source(self) -> None:
        """The fields of a measurement."""
        live = self.bench.measurements.of(self.session)
        last = Wish("") if live is None else live.wish
        with ui.element("div").classes("w-full") as self.fields:
            with ui.element("div").classes("w-full grid grid-cols-1 gap-x-6 md:grid-cols-2"):
                self.source = ui.input("Source", value=last.source).classes("w-full")
                self.record = ui.input("Record the raw rows in", value=next_name(self.session)).classes(
                    "w-full"
                )
                self.to = ui.textarea("Send the rows to, one a line", value="\n".join(last.to)).classes(
                    "w-full"
                )
                self.to.props("rows=1 autogrow")
                every = f"{last.every:g} s" if last.every else ""
                self.every = ui.input("Interval of the rows, each sample if empty", value=every).classes(
                    "w-full"
                )
            ui.label(
                f"Sources: {', '.join(SOURCES)}; a file is one of this session. "
                f"Rows go to {', '.join(each for each in SINKS if each != 'text:-')}; files land beside the recording. "
                "Without a name nothing is recorded."
            ).classes("quiet text-sm")

    def begin(self) -> None:
        """Begin to measure as the fields say."""
        with told():
            to = tuple(line.strip() for line in (self.to.value or "").splitlines() if line.strip())
            wish = Wish(
                (self.source.value or "").strip(),
                (self.record.value or "").strip(),
                to,
                interval_of((self.every.value or "").strip()),
            )
            self.bench.measurements.begin(self.session, wish)
            self.look()

    def stop(self) -> None:
        """Ask the measurement to end."""
        with told():
            self.bench.measurements.stop(self.session)

    def look(self) -> None:
        """Show the state of the measurement."""
        live = self.bench.measurements.of(self.session)
        if live is None:
            self.state.set_text("Nothing is measured.")
            self._can(True)
            self._recorded()
            return
        new = live is not self.shown
        if not new and self.view is not None and self.view.over:
            return
        if new:
            self.shown = live
            self.same.clear()
            self.seen.clear()
            with self.same:
                command(live.command)
            with self.seen:
                self.view = _View(live)
        assert self.view is not None
        ended = live.ended
        found = status(live)
        self.state.set_text(found["words"])
        self.failure.set_text(found["failure"] or found["verdict"])
        self.view.show(found)
        self._can(ended)
        if ended:
            self.view.over = True
            self.record.set_value(next_name(self.session))
            self._recorded()

    def _can(self, begin: bool) -> None:
        """Show what can be done now: begin, or stop."""
        self.start.set_visibility(begin)
        self.end.set_visibility(not begin)
        self.fields.set_visibility(begin)

    def _recorded(self) -> None:
        """Files that were recorded or written, to take elsewhere or to work on."""
        found = recordings(self.session)
        if [path.name for path in found] == self._names:
            return
        self._names = [path.name for path in found]
        self.files.clear()
        with self.files:
            if found:
                heading("Recorded")
            for path in found:
                with ui.row().classes("items-center"):
                    ui.link(path.name, f"/api/v1/sessions/{self.session.id}/live/files/{path.name}")
                    button(
                        "Begin a session with it",
                        partial(self.work_on, path.name),
                        label=f"begin a session with {path.name}",
                    )

    _names: Sequence[str] | None = None

    def work_on(self, name: str) -> None:
        """Begin a session with a recording."""
        with told():
            new = begun_with(self.bench.sessions, self.session, name)
            ui.navigate.to(f"/sessions/{new.id}/recording?new=1")


class _View:
    """The view of a measurement: picture, results, channels, counts, alarms."""

    def __init__(self, live: WishedMeasurement) -> None:
        self.live, self.over = live, False
        self.rows: list[list[Any]] = []
        self.columns: list[str] = []
        self.next, self.title = 0, ""
        self.rest = ui.label().props('data-rest="1"')
        with ui.element("div").classes("w-full grid grid-cols-1 md:grid-cols-2 gap-6"):
            with ui.element("div").classes("w-full"):
                self.choice = ui.select([], label="Over time", on_change=self.chosen).classes("w-full")
                self.plot = ui.plotly(row_figure([], [], "")).classes("w-full")
                self.plot.props('aria-label="the quantity over time, with its band" role="group"')
            with ui.element("div").classes("w-full"):
                heading("Now")
                self.latest = _Values(("Quantity", "Value, ± U (k = 2)", "Unit"), "data-latest")
        with ui.element("div").classes("w-full grid grid-cols-1 md:grid-cols-2 gap-6"):
            with ui.element("div").classes("w-full"):
                heading("Channels as they come")
                self.channels = _Values(("Channel", "Value", "Unit"), "data-channels")
            with ui.element("div").classes("w-full"):
                heading("Alarms")
                self.alarms = ui.element("div").classes("w-full").props('data-alarms="1"')
        self.told: tuple[int, float] | None = None
        heading("Counted")
        self.counts = ui.label().props('data-counts="1"')

    def chosen(self, event: Any) -> None:
        """Draw the quantity that was chosen."""
        self.title = event.value or ""
        self.draw()

    def show(self, found: dict[str, Any]) -> None:
        """Show a status."""
        self.rest.set_text(found["rest_words"])
        self.latest.show(found["latest"])
        self.channels.show(found["channels"])
        self.counts.set_text(found["said"])
        self._alarms(found["alarms"])
        new = rows(self.live, self.next)
        if new["next"] == self.next:
            return
        self.next = new["next"]
        self.rows = (self.rows + new["rows"])[-KEPT:]
        if new["columns"] != self.columns:
            self.columns = new["columns"]
            titles = list(drawable(self.columns))
            self.choice.set_options(titles, value=titles[0] if titles else None)
        self.draw()

    def draw(self) -> None:
        """Draw the rows."""
        self.plot.update_figure(row_figure(self.columns, self.rows, self.title))

    def _alarms(self, found: Sequence[dict[str, Any]]) -> None:
        """The newest messages, where there are other ones."""
        last = (len(found), found[-1]["at"] if found else math.nan)
        if last == self.told:
            return
        self.told = last
        self.alarms.clear()
        with self.alarms:
            if not found:
                ui.label("None.").classes("quiet")
            for each in reversed(found[-_ALARMS:]):
                code = f"{each['code']}: " if each["code"] else ""
                ui.label(f"{each['at']:.1f} s  {code}{each['message']}").classes(
                    "doubt" if each["code"] else ""
                )


class _Values:
    """A table of values that change in their places."""

    def __init__(self, head: Sequence[str], mark: str) -> None:
        self.head, self.place = head, ui.element("div").classes("w-full").props(f"{mark}=1")
        self.names: list[str] = []
        self.cells: dict[str, tuple[ui.label, ui.label]] = {}

    def show(self, found: dict[str, dict[str, Any]]) -> None:
        """Show quantities."""
        if list(found) != self.names:
            self._make(list(found))
        for name, (value, unit) in self.cells.items():
            each = found[name]
            value.set_text(words_of(each["value"], each["u"]))
            unit.set_text("" if each["unit"] == "1" else each["unit"])

    def _make(self, names: list[str]) -> None:
        """A row for each quantity."""
        self.names, self.cells = names, {}
        made: dict[str, list[ui.label]] = {name: [] for name in names}

        def cell(name: str) -> Callable[[], object]:
            return lambda: made[name].append(ui.label())

        self.place.clear()
        with self.place:
            table(self.head, [[name, cell(name), cell(name)] for name in names], {1})
        self.cells = {name: (labels[0], labels[1]) for name, labels in made.items()}
