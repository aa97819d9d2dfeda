"""Home: what is open, running and new; a file dropped begins a session; the shipped examples."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from nicegui import ui

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.jobs import ENDED, Job, JobState
from inercal.bench.workbench.pages.frame import button, framed, heading, table, told
from inercal.bench.workbench.sessions import Session
from inercal.examples import EXAMPLES, Example
from inercal.faces.python.study import PLANNED
from inercal.systems.listed import SYSTEMS

_SHOWN = 20
_EVERY = 1.0
"""Time [s] between two looks at the queue."""


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
            _watched(bench, bool(every))
            heading("Shipped examples")
            rows: list[list[str | Callable[[], object]]] = [
                [example.name, _title(example), partial(_button, example.name, begin)]
                for example in EXAMPLES.values()
            ]
            table(["Name", "What it is", ""], rows)
            heading("Plan a test")
            with ui.row():
                for kind in PLANNED:
                    button(SYSTEMS[kind].title, partial(plan, kind), label=f"plan: {SYSTEMS[kind].title}")


def _title(example: Example) -> str:
    """The title of an example; with its command, where that has no page here."""
    has_page = example.verb in {system.command for system in SYSTEMS.values()}
    return (
        example.title if has_page else f"{example.title}; to look at, its command is inercal {example.verb}"
    )


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


def _watched(bench: Bench, every: bool) -> None:
    """Jobs that run or wait, and the sessions; drawn anew when a job begins or ends."""
    place = ui.element("div").classes("w-full flex flex-col gap-3")
    at_work: list[tuple[str, JobState]] | None = None
    progress: dict[str, ui.label] = {}

    def look() -> None:
        nonlocal at_work
        jobs = [job for job in bench.queue if job.state not in ENDED]
        now = [(job.id, job.state) for job in jobs]
        if now != at_work:
            at_work = now
            place.clear()
            with place:
                progress.clear()
                progress.update(_at_work(bench, jobs))
                heading("Sessions")
                sessions(bench, every)
        for job in jobs:
            progress[job.id].set_text(job.progress or job.state.value)

    look()
    ui.timer(_EVERY, look)


def _at_work(bench: Bench, jobs: list[Job]) -> dict[str, ui.label]:
    """The jobs that run or wait, the next first, each with the label of what it is at."""
    if not jobs:
        return {}
    heading("At work")
    made: dict[str, ui.label] = {}
    titles = {session.id: session.title for session in bench.sessions}

    def state(job: Job) -> None:
        made[job.id] = ui.label()

    def of_session(job: Job) -> None:
        if job.session in titles:
            ui.link(f"{job.session} {titles[job.session]}", f"/sessions/{job.session}/run")
        else:
            ui.label(job.session)

    table(
        ["Job", "Session", "Command", "State"],
        [
            [job.id, partial(of_session, job), " ".join(job.arguments[:2]), partial(state, job)]
            for job in reversed(jobs)
        ],
    )
    return made


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
                SYSTEMS[session.kind].title,
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
