"""Run: what a job is at, cancel, the queue; the page only looks, the job goes on without it."""

from __future__ import annotations

import re

from nicegui import ui

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.jobs import ENDED, Job, JobState
from inercal.bench.workbench.pages.frame import button, command, framed, heading, table, told
from inercal.bench.workbench.sessions import Session
from inercal.foundation.records.places import counted

_EVERY = 0.3
"""Time [s] between two looks at a job."""

WORDS = {
    JobState.WAITING: "waits for the jobs before it",
    JobState.RUNNING: "is running",
    JobState.DONE: "is done",
    JobState.REFUSED: "was refused",
    JobState.CANCELLED: "was cancelled",
    JobState.INTERRUPTED: "was interrupted when the workbench ended: start it again",
}


def add(bench: Bench) -> None:
    """Add the page."""

    @ui.page("/sessions/{number}/run")
    def show(number: str) -> None:
        session = bench.sessions.get(number)
        with framed("Run", session, "run"):
            job = bench.last_job(session)
            if job is None:
                ui.label("Nothing was run yet.")
                _begin(bench, session, "Run")
                return
            ui.label(f"Session {session.id}, {session.title}; job {job.id}").classes("quiet")
            _follow(bench, session, job)
            heading("Jobs of this session")
            _jobs(bench, session)


def _begin(bench: Bench, session: Session, words: str) -> None:
    """The button that puts the calibration into the queue."""

    def begin() -> None:
        with told():
            bench.run(session)
            ui.navigate.reload()

    button(words, begin, main=True)


def _follow(bench: Bench, session: Session, job: Job) -> None:
    """The state of a job until it has ended."""
    begun = job.state in ENDED
    state = ui.label().classes("verdict").props('role="status" data-state="1"')
    bar = ui.linear_progress(show_value=False).props('aria-label="at work"')
    said = ui.label().classes("command")
    command(job.command)
    with ui.row():
        cancel = button("Cancel", lambda: bench.queue.cancel(job.id))
        again = ui.element("div")
    with again:
        _begin(bench, session, "Run again")

    def look() -> None:
        now = bench.queue.get(job.id)
        progress = now.progress if now.state is JobState.RUNNING else ""
        state.set_text(f"The job {_words(bench, now)}" + (f": {progress}" if progress else ""))
        part = part_of(progress)
        bar.props(remove="indeterminate") if part is not None else bar.props("indeterminate")
        bar.set_value(part or 0.0)
        said.set_text(now.said)
        over = now.state in ENDED
        bar.set_visibility(not over)
        cancel.set_visibility(not over)
        again.set_visibility(over)
        if over:
            timer.deactivate()
            if now.state is JobState.DONE and not begun:
                ui.navigate.to(f"/sessions/{session.id}/result")

    timer = ui.timer(_EVERY, look)


def _words(bench: Bench, job: Job) -> str:
    """The state of a job; where it waits, for how many."""
    before = sum(each.state not in ENDED and each.id < job.id for each in bench.queue)
    if job.state is JobState.WAITING and before:
        return f"waits for {counted(before, 'job')} before it"
    return WORDS[job.state]


def part_of(progress: str) -> float | None:
    """The part of the work that is done, where the words of its progress say so; else None."""
    if match := re.search(r"(\d+) %", progress):
        return min(int(match[1]) / 100.0, 1.0)
    if match := re.search(r"(\d+) of (\d+)", progress):
        return min(int(match[1]) / max(int(match[2]), 1), 1.0)
    return None


def _jobs(bench: Bench, session: Session) -> None:
    """All jobs of a session."""
    rows = [
        [job.id, job.state.value, job.made[:19].replace("T", " "), job.command]
        for job in bench.queue
        if job.session == session.id
    ]
    table(["Job", "State", "Made (UTC)", "Command"], rows)
