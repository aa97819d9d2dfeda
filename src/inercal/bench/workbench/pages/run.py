"""Run, and validation: the state of a job, cancel, the queue; the page only looks, the job goes on without it."""

from __future__ import annotations

import re
from collections.abc import Callable

from nicegui import ui

from inercal.bench.workbench.bench import VALIDATION, Bench
from inercal.bench.workbench.jobs import ENDED, Job, JobState
from inercal.bench.workbench.pages.frame import button, command, framed, heading, report, table, told
from inercal.bench.workbench.sessions import Session
from inercal.foundation.records.places import counted

_EVERY = 0.3
"""Time [s] between two looks at a job."""

_WORDS = {
    JobState.WAITING: "waits for the jobs before it",
    JobState.RUNNING: "is running",
    JobState.DONE: "is done",
    JobState.REFUSED: "was refused",
    JobState.CANCELLED: "was cancelled",
    JobState.INTERRUPTED: "was interrupted when the workbench ended: start it again",
}


def add(bench: Bench) -> None:
    """Add the pages: of a session, and of the validation."""

    @ui.page("/validation")
    def validation() -> None:
        with framed("Validation"):
            ui.label("Published and closed-form cases that ship with inercal, run on this machine.")

            def begin() -> None:
                with told():
                    bench.validate()
                    ui.navigate.reload()

            button("Run the validation", begin, main=True)
            command("inercal validate --report validation.html")
            if (job := next((job for job in bench.queue if job.session == VALIDATION), None)) is not None:
                state = ui.label().classes("verdict").props('role="status"')
                place = ui.element("div").classes("w-full")
                followed(bench, job, state, f"Job {job.id}", "record of the validation", place)

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


def followed(
    bench: Bench,
    job: Job,
    state: ui.label,
    what: str,
    title: str,
    place: ui.element,
    ended: Callable[[Job], None] = lambda _: None,
) -> None:
    """Tell the ``state`` of ``what`` until it has ended; its report, under its ``title``, then stands in ``place``."""

    def look() -> None:
        now = bench.queue.get(job.id)
        progress = f": {now.progress}" if now.state is JobState.RUNNING and now.progress else ""
        state.set_text(f"{what} {_WORDS[now.state]}{progress}")
        if now.state not in ENDED:
            return
        timer.deactivate()
        with place:
            ended(now)
            if now.report is not None:
                report(now, title)

    timer = ui.timer(_EVERY, look)


def _words(bench: Bench, job: Job) -> str:
    """The state of a job; where it waits, for how many."""
    before = sum(each.state not in ENDED and each.id < job.id for each in bench.queue)
    if job.state is JobState.WAITING and before:
        return f"waits for {counted(before, 'job')} before it"
    return _WORDS[job.state]


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
