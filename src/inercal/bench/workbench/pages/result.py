"""Result: the verdict first, then the picture, coefficients with U, budget, findings; kept, certified, handed on."""

from __future__ import annotations

import asyncio
from functools import partial
from urllib.parse import urlencode

from nicegui import events, ui

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.charts import parts_of, residual_figure, span_of
from inercal.bench.workbench.jobs import Job, JobState
from inercal.bench.workbench.pages.form import Advice, advice_of
from inercal.bench.workbench.pages.frame import (
    PATIENCE,
    button,
    command,
    framed,
    heading,
    picture,
    refused,
    report,
    said,
    table,
    told,
)
from inercal.bench.workbench.sessions import Session
from inercal.faces.python.result import Result
from inercal.foundation._files import read_bytes
from inercal.foundation.errors import InercalError
from inercal.foundation.findings import Status
from inercal.foundation.records.places import counted
from inercal.foundation.results.shown import rounded
from inercal.systems.listed import SYSTEMS
from inercal.systems.strapdown.system import SYSTEM as STRAPDOWN


def add(bench: Bench) -> None:
    """Add the page."""

    @ui.page("/sessions/{number}/result", response_timeout=PATIENCE)
    async def show(number: str) -> None:
        session = bench.sessions.get(number)
        with framed("Result", session, "result"):
            job = bench.last_job(session)
            if job is None or job.result is None:
                ui.label("There is no result yet: run the session first.")
                return
            try:
                result = await asyncio.to_thread(bench.result, job)
            except InercalError as error:
                refused(error)
                return
            _verdict(bench, session, result)
            _residuals(session, result)
            place = ui.element("div").classes("" if job.report is None else "place-of-report")
            _coefficients(result)
            _budget(result)
            if result.status is Status.OK:
                _findings(bench, session, result)
            heading("Take it along")
            with ui.row():
                for name, words in (("result.json", "Result (JSON)"), ("report.html", "Report (HTML)")):
                    if (job.folder / name).is_file():
                        ui.link(words, f"/api/v1/jobs/{job.id}/files/{name}", new_tab=True)
            if SYSTEMS[session.kind].converts:
                _converted(bench, job)
            _compared(bench, job)
            _kept(bench, job)
            _certificate(bench, job)
            heading("The same from the command line")
            command(job.command)
        if job.report is not None:
            await ui.context.client.connected()  # a page does not wait for its report
            with place:
                report(job, "report")


_BY_TURNS = f"inercal {STRAPDOWN.command}"
"""The other method, which a verdict may advise."""

_COLOURS = {Status.OK: "ok", Status.SUSPECT: "doubt"}


def _verdict(bench: Bench, session: Session, result: Result) -> None:
    """The verdict in its colour, and before all else what makes it other than ok."""
    ui.label(f"{result.status.value}: {result.message}").classes(
        "verdict " + _COLOURS.get(result.status, "bad")
    ).props('data-verdict="1"')
    if session.kind != STRAPDOWN.kind and _BY_TURNS in result.message:
        button(f"Begin again with {_BY_TURNS}", partial(_begin_again, bench, session))
    if result.status is not Status.OK:
        _findings(bench, session, result)


def _findings(bench: Bench, session: Session, result: Result) -> None:
    """The findings, with their advice."""
    if not result.findings:
        return
    study = "" if session.study is None else read_bytes(session.study).decode(errors="replace")
    advised = {finding: advice_of(finding, study, session.kind) for finding in result.findings}
    shown = result.status is not Status.OK or any(advised.values())
    with ui.expansion(counted(len(result.findings), "finding"), value=shown).classes("w-full"):
        for finding, advice in advised.items():
            said(finding)
            for each in advice:
                button(f"Set {each.words}", partial(_take, bench, session, each))


def _begin_again(bench: Bench, session: Session) -> None:
    """Begin a session by the other method, and open its study."""
    with told():
        made = bench.again_as(session, STRAPDOWN.kind)
        ui.navigate.to(f"/sessions/{made.id}/study")


def _take(bench: Bench, session: Session, advice: Advice) -> None:
    """Change the study as a finding advises, and open it."""
    with told():
        bench.change(session, advice.path, advice.value)
        ui.navigate.to(f"/sessions/{session.id}/study")


def _residuals(session: Session, result: Result) -> None:
    """Residuals over the time of the recording; one that is clicked leads to its samples."""
    parts = parts_of(result.estimate.result)
    if not parts:
        return
    heading("Residuals")
    plot = picture(residual_figure(parts), "residuals over time")
    place = ui.element("div").props('aria-live="polite" data-chosen="1"')
    with place:
        ui.label("Click one to see its samples.").classes("quiet text-sm")

    def choose(event: events.GenericEventArguments) -> None:
        points = event.args.get("points") if isinstance(event.args, dict) else None
        if not points:
            return
        label = str(points[0]["customdata"])
        begin, end = span_of(parts, label)
        margin = 0.5 * (end - begin) + 1.0
        plot.update_figure(residual_figure(parts, label))
        place.clear()
        with place:
            target = urlencode({"begin": begin - margin, "end": end + margin})
            ui.link(
                f"Samples of {label}, {begin:.5g} s to {end:.5g} s",
                f"/sessions/{session.id}/recording?{target}",
            )

    plot.on("plotly_click", choose)


def _coefficients(result: Result) -> None:
    """The coefficients with U, in the units of the command line."""
    if not result.names:
        return
    heading("Coefficients")
    rows = []
    for parameter in result.view.shown.parameters.values():
        value, u, expanded = rounded(parameter.value, parameter.u, parameter.U)[:3]
        rows.append([parameter.name, value, u, expanded, f"{parameter.k:.2f}", parameter.unit])
    table(["Name", "Value", "u", "U", "k", "Unit"], rows, {1, 2, 3, 4})


def _budget(result: Result) -> None:
    """The sources of the uncertainty."""
    shares: dict[str, float] = {}
    for item in result.estimate.budget:
        shares[item.source] = max(shares.get(item.source, 0.0), max(item.share.values(), default=0.0))
    if shares:
        heading("Where the uncertainty comes from")
        ordered = sorted(shares.items(), key=lambda each: -each[1])
        table(
            ["Source", "Largest share of a variance"],
            [[name, f"{100 * share:.0f} %"] for name, share in ordered[:12]],
            {1},
        )


def _converted(bench: Bench, job: Job) -> None:
    """The calibration in the files of other tools."""
    from inercal.faces.convert.other_tools import CONVENTIONS

    place = ui.element("div").classes("w-full")

    async def convert(tool: str) -> None:
        with told():
            ended = await _done(bench, bench.convert(job, tool), f"It is written for {tool}.", place)
            with place:
                for path in sorted(ended.folder.glob(f"{tool}*")):
                    ui.link(path.name, f"/api/v1/jobs/{ended.id}/files/{path.name}", new_tab=True)

    with ui.row().classes("items-center"):
        ui.label("For other tools:")
        for tool in CONVENTIONS:
            button(tool, partial(convert, tool), label=f"write for {tool}")


def _compared(bench: Bench, job: Job) -> None:
    """Set the result beside another of the same kind."""
    titles = {session.id: session.title for session in bench.sessions}  # a session may have been deleted
    others = {
        each.id: f"job {each.id}, {titles.get(each.session, 'deleted session')}, {each.made[:16]}"
        for each in bench.queue
        if each.calibrates and each.result is not None and each.id != job.id
    }
    if not others:
        return
    heading("Beside another result")
    chosen = ui.select(others, label="Earlier result").classes("w-96 max-w-full")
    place = ui.element("div").classes("w-full")

    async def compare() -> None:
        with told():
            asked = bench.compare(bench.queue.get(chosen.value), job)
            ended = await asyncio.to_thread(bench.queue.wait, asked.id, 60.0)
            place.clear()
            if ended.report is None:
                _say(ended, "")
                return
            with place:
                report(ended, "comparison")
                command(ended.command)

    button("Compare", compare)


def _kept(bench: Bench, job: Job) -> None:
    """Keep the result in the store of the laboratory."""
    heading("Keep it")
    name = ui.input("Instrument: maker, model, serial").classes("w-96 max-w-full")
    ui.label("Where the study names the instrument under [item], leave it empty.").classes("quiet text-sm")

    async def keep() -> None:
        with told():
            await _done(bench, bench.keep(job, name.value or ""), "It is kept.", place)

    button("Keep", keep)
    place = ui.element("div").classes("w-full")


def _certificate(bench: Bench, job: Job) -> None:
    """Write a certificate, with what the laboratory states."""
    from inercal.laboratory.certificate.lab import lab_template

    heading("Certificate")
    text = read_bytes(bench.lab).decode() if bench.lab.is_file() else lab_template()
    with ui.expansion("What the laboratory states (lab.toml)", value=not bench.lab.is_file()).classes(
        "w-full"
    ):
        editor = (
            ui.textarea(value=text).props('outlined autogrow aria-label="lab.toml"').classes("w-full command")
        )

        def state() -> None:
            with told():
                bench.state(editor.value)
                ui.notify("The statements of the laboratory are kept.")

        button("Save lab.toml", state)
    number = ui.input("Number of the certificate")

    async def certify() -> None:
        with told():
            asked = bench.certify(job, number.value or "")
            ended = await _done(bench, asked, "The certificate is written.", place)
            if ended.code == 0:
                with place:
                    for file, words in (("certificate.xml", "XML"), ("certificate.html", "page")):
                        ui.link(
                            f"Certificate, {words}", f"/api/v1/jobs/{ended.id}/files/{file}", new_tab=True
                        ).classes("mr-4")

    button("Write the certificate", certify)
    place = ui.element("div").classes("w-full")


async def _done(bench: Bench, job: Job, words: str, place: ui.element) -> Job:
    """A job once it has ended; how it has is told, and its command stands in ``place``."""
    ended = await asyncio.to_thread(bench.queue.wait, job.id, 60.0)
    _say(ended, words)
    place.clear()
    with place:
        command(ended.command)
    return ended


def _say(job: Job, words: str) -> None:
    """Tell how a job has ended that one waited for."""
    good = job.state is JobState.DONE and job.code == 0
    said = job.said.strip() or job.state.value
    ui.notify(words if good else said, type="positive" if good else "negative", multi_line=True, close_button="Close",
              timeout=5000 if good else 0)  # fmt: skip
