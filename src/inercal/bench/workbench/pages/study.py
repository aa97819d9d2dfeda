"""Study: a form beside its TOML, each following the other, checked as one types."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

from nicegui import events, ui

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.pages.form import FormKey, FormTable, as_toml, problem, tables
from inercal.bench.workbench.pages.frame import button, command, copy, framed, heading, refused, saved, told
from inercal.bench.workbench.sessions import STUDY, Session, put
from inercal.faces.studies.text import changed, parsed
from inercal.foundation._files import read_bytes
from inercal.foundation.errors import InercalError
from inercal.systems.listed import SYSTEMS

_PAUSE = 400
"""Pause in typing [ms] after which a study is judged; leaving the field ends it too."""

_OPEN = "?"
"""Value of a key that is to be filled in."""


def add(bench: Bench) -> None:
    """Add the page."""

    @ui.page("/sessions/{number}/study")
    def study(number: str) -> None:
        session = bench.sessions.get(number)
        with framed("Study", session, "study"):
            if session.study is None:
                _without(bench, session)
                return
            ui.label(f"Session {session.id}: {SYSTEMS[session.kind].title}").classes("quiet")
            Editor(bench, session)


def _without(bench: Bench, session: Session) -> None:
    """A session that has no study yet."""
    ui.label("There is no study yet: drop one on the page, or begin with one for the recordings.")

    def begin() -> None:
        with told():
            bench.begin_study(session, session.kind)
            ui.navigate.reload()

    button("Begin a study", begin, main=True)


class Editor:
    """The two views of one study: what is typed in one is written to the file, and seen in the other."""

    def __init__(self, bench: Bench, session: Session) -> None:
        self.session = session
        self.text = read_bytes(session.folder / STUDY).decode(errors="replace")
        with ui.element("div").classes("judged"):  # in sight of every key
            self.verdict = ui.label().props('role="status" data-verdict="1"')
        button("Run", lambda: self.run(bench), main=True)
        with told():
            command(shlex.join(["inercal", *session.command(Path("cal.json"), Path("cal.html"))]))
        with ui.element("div").classes("w-full grid grid-cols-1 md:grid-cols-2 gap-6"):
            self.form = ui.element("div")
            with ui.element("div").classes("copies"):
                heading("The study as text")
                self.source = ui.textarea(value=self.text, on_change=lambda event: self.typed(event.value))
                self.source.props(f'outlined autogrow debounce={_PAUSE} aria-label="study as TOML"').classes(
                    "w-full command"
                )
                with ui.row().classes("items-center"):
                    copy(f"copy {STUDY}")
                    saved(session, STUDY)
        self.fill()
        self.judge()

    def run(self, bench: Bench) -> None:
        """Begin the calibration, and show it."""
        with told():
            bench.run(self.session)
            ui.navigate.to(f"/sessions/{self.session.id}/run")

    def typed(self, text: str) -> None:
        """The text was changed: so is the form."""
        if text == self.text:
            return
        self.text = text
        with told():
            put(self.session, STUDY, text)
        self.judge()
        self.fill()

    def change(self, key: FormKey, value: str) -> None:
        """A key of the form was changed: so is the text."""
        with told():
            self.text = changed(self.text, key.path, as_toml(value, key.widget))
            put(self.session, STUDY, self.text)
            self.source.set_value(self.text)
            self.judge()

    def judge(self) -> None:
        """Say what is wrong with the study."""
        words = problem(self.session.kind, self.text)
        self.verdict.set_text(words or "The study can be used.")
        self.verdict.classes(replace="bad" if words else "ok")

    def fill(self) -> None:
        """Draw the form: tables that the study has first, the others folded."""
        self.form.clear()
        with self.form:
            try:
                found = tables(self.session.kind, self.text)
                data = parsed(self.text)
            except InercalError as error:
                refused(error)
                return
            given = {each.name: bool(data) and any(key.value for key in each.keys) for each in found}
            for each in sorted(found, key=lambda each: not given[each.name]):
                self.table(each, given[each.name])

    def table(self, table: FormTable, given: bool) -> None:
        """One table: the keys it has, then those it may have."""
        if not given:
            head = f"[{table.name}] {table.says}" if table.name else "Tables of names of one's own"
            self.folded(head, table.keys)
            return
        heading(f"[{table.name}]" if table.name else "Tables of names of one's own")
        if table.name:
            ui.label(table.says).classes("quiet")
        self.keys(tuple(key for key in table.keys if key.value))
        more = tuple(key for key in table.keys if not key.value)
        if more:
            self.folded(f"{len(more)} more keys of [{table.name}]", more)

    def folded(self, head: str, keys: tuple[FormKey, ...]) -> None:
        """Keys that are drawn when somebody opens them."""
        place = ui.expansion(head).classes("w-full").props("dense")
        drawn: list[bool] = []

        def opened(event: events.ValueChangeEventArguments[bool]) -> None:
            if event.value and not drawn:
                drawn.append(True)
                with place:
                    self.keys(keys)

        place.on_value_change(opened)

    def keys(self, keys: tuple[FormKey, ...]) -> None:
        """Keys, each as it is typed."""
        for key in keys:
            with ui.element("div").classes("w-full mb-2"):
                _WIDGETS[key.widget](key, self.change)
                ui.label(key.says).classes("quiet text-sm")


Changed = Callable[[FormKey, str], None]


def _choice(key: FormKey, change: Changed) -> None:
    """A choice among words."""
    ui.select(
        ["", *key.choices], value=key.value if key.value in key.choices else "", label=key.name,
        on_change=lambda event: change(key, event.value),
    ).props("dense outlined").classes("w-full")  # fmt: skip


def _switch(key: FormKey, change: Changed) -> None:
    """True or false."""
    ui.checkbox(
        key.name, value=key.value == "true", on_change=lambda event: change(key, str(event.value).lower())
    )


def _typed(key: FormKey, change: Changed) -> None:
    """A text, a quantity with its unit, or a value of TOML."""
    field = ui.input(
        label=key.name, value="" if key.value == _OPEN else key.value, placeholder=key.example,
        on_change=lambda event: change(key, event.value or ""),
    ).props(f"dense outlined stack-label debounce={_PAUSE}").classes("w-full")  # fmt: skip
    if key.value == _OPEN:
        field.props('hint="to be filled in"')


_WIDGETS: dict[str, Callable[[FormKey, Changed], None]] = {
    "choice": _choice,
    "switch": _switch,
    "text": _typed,
    "value": _typed,
}
