"""Home: what is open, running and new; a file dropped begins a session; the shipped examples."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from nicegui import ui

from inercal.examples import EXAMPLES
from inercal.face.foresight import PLANNED
from inercal.workbench.bench import KINDS, Bench
from inercal.workbench.pages.frame import button, framed, heading, table, told
from inercal.workbench.sessions import COMMANDS, Session

_SHOWN = 20


def add(bench: Bench) -> None:
    """Add the page."""

    def begin(name: str) -> None:
        with told():
            session = bench.sessions.begin_with(name)
            ui.navigate.to(f"/sessions/{session.id}/recording")

    def plan(kind: str) -> None:
        with told():
            session = bench.plan(kind)
            ui.navigate.to(f"/sessions/{session.id}/design")

    @ui.page("/")
    def home(every: str = "") -> None:
        with framed("Home"):
            drop()
            heading("Sessions")
            sessions(bench, bool(every))
            heading("Shipped examples")
            verbs = {" ".join(words) for words in COMMANDS.values()}
            rows: list[list[str | Callable[[], object]]] = [
                [example.name, example.title, partial(_button, example.name, begin)]
                for example in EXAMPLES.values()
                if example.verb in verbs and len(example.records) < 3
            ]
            table(["Name", "What it is", ""], rows)
            heading("Plan a test")
            with ui.row():
                for kind in PLANNED:
                    button(KINDS[kind], partial(plan, kind), label=f"plan: {KINDS[kind]}")


def _button(name: str, begin: Callable[[str], None]) -> None:
    """The button that begins a session with an example."""
    button("Open", lambda: begin(name), label=f"open example {name}")


def drop() -> None:
    """The place for recordings, a map or a study, to drop or to choose."""
    with ui.element("div").classes("drop"):
        ui.label(
            "Drop a recording anywhere on the page, with its column map or study if there is one, or choose:"
        )
        ui.element("input").props(
            'type=file multiple aria-label="choose recordings" onchange="inercalTake(this)"'
        )


def sessions(bench: Bench, every: bool) -> None:
    """The newest sessions, or every one, each with its last job."""
    rows, found = [], [*bench.sessions]
    for session in found if every else found[:_SHOWN]:
        job = bench.last_job(session)
        rows.append(
            [
                partial(
                    ui.link,
                    f"{session.id} {session.title}",
                    f"/sessions/{session.id}/{_step(bench, session)}",
                ),
                KINDS[session.kind],
                "" if job is None else job.state.value,
                session.made[:16].replace("T", " "),
            ]
        )
    if rows:
        table(["Session", "Kind", "Last run", "Begun (UTC)"], rows)
        if len(found) > len(rows):
            ui.link(f"Show all {len(found)} sessions", "/?every=1")
    else:
        ui.label("None yet.").classes("quiet")


def _step(bench: Bench, session: Session) -> str:
    """The page on which a session goes on."""
    job = bench.last_job(session)
    if job is None:
        return "recording"
    return "result" if job.result is not None else "run"
