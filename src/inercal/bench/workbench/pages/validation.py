"""Validation: the published and closed-form cases run again, on a page to sign."""

from __future__ import annotations

from nicegui import ui

from inercal.bench.workbench.bench import VALIDATION, Bench
from inercal.bench.workbench.jobs import ENDED, Job, JobState
from inercal.bench.workbench.pages.frame import button, command, framed, report, told
from inercal.bench.workbench.pages.run import WORDS


def add(bench: Bench) -> None:
    """Add the page."""

    @ui.page("/validation")
    def show() -> None:
        with framed("Validation"):
            job = next((job for job in bench.queue if job.session == VALIDATION), None)

            def begin() -> None:
                with told():
                    bench.validate()
                    ui.navigate.reload()

            ui.label("Published and closed-form cases that ship with inercal, run on this machine.")
            button("Run the validation", begin, main=True)
            command("inercal validate --report validation.html")
            if job is not None:
                _follow(bench, job)


def _follow(bench: Bench, job: Job) -> None:
    """The state of the last validation, and its page."""
    state = ui.label().classes("verdict").props('role="status"')
    place = ui.element("div").classes("w-full")

    def look() -> None:
        now = bench.queue.get(job.id)
        progress = f": {now.progress}" if now.state is JobState.RUNNING and now.progress else ""
        state.set_text(f"Job {now.id} {WORDS[now.state]}{progress}")
        if now.state not in ENDED:
            return
        timer.deactivate()
        if now.report is not None:
            with place:
                report(now, "record of the validation")

    timer = ui.timer(0.3, look)
