"""The frame of all pages: head, ways to the others, the words of an error."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence, Set
from contextlib import contextmanager
from typing import Any

from nicegui import ui
from starlette.requests import Request

from inercal.bench.workbench.bench import said_of
from inercal.bench.workbench.jobs import Job
from inercal.bench.workbench.sessions import Session
from inercal.foundation.findings import Finding

_STEPS = (
    ("recording", "Recording"),
    ("study", "Study"),
    ("design", "Design"),
    ("run", "Run"),
    ("result", "Result"),
    ("live", "Live"),
)
PATIENCE = 120.0
"""Time [s] that a page may take where it reads files, on a busy machine."""

_DARK = "inercal-dark"
"""Cookie of the browser that keeps whether pages are dark; without it they are as the system is."""

_CHOSEN = {"0": False, "1": True}

_PLACES = (("/", "Home"), ("/live", "Live"), ("/instruments", "Instruments"), ("/validation", "Validation"))


@contextmanager
def framed(title: str, session: Session | None = None, step: str = "") -> Iterator[None]:
    """A page with its head; of a session with the ways to its steps."""
    ui.page_title(f"{title} - inercal")
    ui.colors(primary="#2F6690", negative="#C03A2B", positive="#1E7A4C")
    ui.add_head_html('<link rel="stylesheet" href="/static/bench.css">')
    ui.add_head_html('<script src="/static/bench.js" defer></script>')
    dark = ui.dark_mode(value=_CHOSEN.get(_request().cookies.get(_DARK, "")))

    def choose(on: bool) -> None:
        dark.set_value(on)
        ui.run_javascript(f"document.cookie = '{_DARK}={int(on)}; path=/; SameSite=Strict; max-age=31536000'")

    with ui.element("nav").props('aria-label="pages"').classes("w-full flex gap-4 items-center"):
        ui.label("inercal workbench").classes("font-bold")
        for target, words in _PLACES:
            _way(target, words, words == title)
        ui.space()
        button("Light", lambda: choose(False))
        button("Dark", lambda: choose(True))
    if session is not None:
        with ui.element("nav").props('aria-label="steps"').classes("w-full flex gap-4"):
            for name, words in _STEPS:
                _way(f"/sessions/{session.id}/{name}", words, name == step)
    with ui.element("main").classes("w-full flex flex-col gap-3"):
        with ui.element("h1"):
            ui.label(title)
        yield


def _request() -> Request:
    """The request for the page that is being made."""
    request = ui.context.client.request
    assert request is not None
    return request


def _way(target: str, words: str, here: bool) -> None:
    """A link to a page, marked where one is."""
    link = ui.link(words, target)
    if here:
        link.props('aria-current="page"').classes("font-bold no-underline")


def refused(error: BaseException) -> None:
    """Show why something cannot be done."""
    ui.label(said_of(error)).classes("bad").props('role="alert"')


@contextmanager
def told() -> Iterator[None]:
    """Tell an error of what a button does in a message on the page."""
    try:
        yield
    except Exception as error:
        ui.notify(said_of(error), type="negative", multi_line=True, close_button="Close", timeout=0)


def command(words: str) -> None:
    """The command that does the same, to copy."""
    with ui.row(wrap=False).classes("items-center w-full copies"):
        ui.label(words).classes("command grow").props('data-command="1"')
        copy("copy the command")


def copy(label: str) -> None:
    """The button that copies the command or the text which stands in the same ``copies``."""
    made = (
        ui.button("Copy", color=None)
        .props(f'no-caps unelevated aria-label="{label}"')
        .classes("act self-start")
    )
    made.on("click", js_handler="(event) => inercalCopy(event.currentTarget)")


def picture(figure: dict[str, Any], label: str) -> ui.plotly:
    """A picture of plotly. Its height is there before it is drawn, so that nothing below moves under a click."""
    made = ui.plotly(figure).classes("w-full").props(f'aria-label="{label}" role="group"')
    return made.style(f"min-height: {figure['layout']['height']}px")


def saved(session: Session, name: str) -> None:
    """The way to a file of a session, to keep it elsewhere."""
    ui.link(f"Save {name} elsewhere", f"/api/v1/sessions/{session.id}/files/{name}")


def button(words: str, act: Callable[[], object], label: str = "", main: bool = False) -> ui.button:
    """A button that does something; the ``main`` one of a page is filled. ``label`` says more than its words."""
    made = ui.button(words, on_click=act, color=None).props("no-caps unelevated")
    made.classes("act main self-start" if main else "act self-start")
    if label:
        made.props(f'aria-label="{label}"')
    return made


def report(job: Job, title: str) -> None:
    """The page that a job wrote, in a frame of its own: it may hold names from a foreign file."""
    ui.element("iframe").props(
        f'src="/api/v1/jobs/{job.id}/files/report.html" title="{title}" sandbox="allow-scripts allow-popups"'
    ).classes("report")


def heading(words: str) -> None:
    """The head of a part of a page."""
    with ui.element("h2"):
        ui.label(words)


def said(finding: Finding) -> None:
    """A finding: what it is, what to do about it, and the table of its items."""
    where = f" ({finding.where})" if finding.where else ""
    ui.label(f"{finding.code}: {finding.headline}{where}").classes("doubt")
    if finding.action:
        ui.label(f"→ {finding.action[:1].upper()}{finding.action[1:]}").classes("ml-4").props(
            'data-action="1"'
        )
    heads, rows = finding.table
    if rows:
        table(heads, rows)


def table(
    head: Sequence[str], rows: Sequence[Sequence[str | Callable[[], object]]], numbers: Set[int] = frozenset()
) -> None:
    """A table of texts, or of what a callback makes; columns of ``numbers`` end at the right."""
    place = (
        ui.element("div").classes("scroll").props(f'tabindex=0 role="region" aria-label="table by {head[0]}"')
    )
    with place, ui.element("table").classes("plain"):
        with ui.element("thead"), ui.element("tr"):
            for k, words in enumerate(head):
                with ui.element("th").props('scope="col"').classes("number" if k in numbers else ""):
                    ui.label(words)
        with ui.element("tbody"):
            for row in rows:
                with ui.element("tr"):
                    for k, cell in enumerate(row):
                        with ui.element("td").classes("number" if k in numbers else ""):
                            if callable(cell):
                                cell()
                            else:
                                ui.label(cell)
