"""Design: a test before it is made: where its plan stops, and the uncertainties to expect."""

from __future__ import annotations

import asyncio
import shlex
import threading
from collections.abc import Callable

import numpy as np
from nicegui import events, ui

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.jobs import Job, JobState
from inercal.bench.workbench.pages.form import lines_of, named, with_found, with_lines
from inercal.bench.workbench.pages.frame import (
    PATIENCE,
    button,
    command,
    framed,
    heading,
    refused,
    table,
    told,
)
from inercal.bench.workbench.pages.run import followed
from inercal.bench.workbench.sessions import STUDY, Session, put
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres
from inercal.faces.studies.text import with_keys
from inercal.foundation._files import read_bytes
from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight
from inercal.foundation.errors import InercalError
from inercal.foundation.results.shown import short
from inercal.systems.contract import OfferedPlan
from inercal.systems.listed import SYSTEMS

_MIDDLE, _END = 50, 100
"""Places of a slider: as stated in the middle, where a browser puts it, ten times as much or a tenth at the ends."""

_DRAWING = threading.Lock()
"""The style of a picture is that of the whole process while it is drawn."""


def add(bench: Bench) -> None:
    """Add the page."""

    @ui.page("/sessions/{number}/design", response_timeout=PATIENCE)
    async def design(number: str) -> None:
        session = bench.sessions.get(number)
        with framed("Design", session, "design"):
            if (plan := SYSTEMS[session.kind].plan) is None:
                ui.label("An IMU that is moved by hand has no plan: its poses are found from the recording.")
                return
            if session.study is None:
                ui.label("There is no study yet, which would say what is planned.")
                ui.link("Begin one", f"/sessions/{session.id}/study")
                return
            desk = Desk(bench, session, plan)
            await ui.context.client.connected()
            await desk.judge()


class Desk:
    """The plan of a study, edited as lines; what is shown follows."""

    def __init__(self, bench: Bench, session: Session, plan: OfferedPlan) -> None:
        self.bench, self.session, self.plan, self.plans = bench, session, plan, named(plan)
        self.foresight: Foresight | None = None
        self.factors: Array = np.ones(0)
        self.text = read_bytes(session.folder / STUDY).decode(errors="replace")
        self.verdict = ui.label().props('role="status" data-verdict="1"')
        with ui.element("div").classes("w-full grid grid-cols-1 md:grid-cols-2 gap-6"):
            with ui.element("div"):
                self._plan()
            self.stops = ui.element("div").classes("w-full")
        heading("What if")
        ui.label("Move a slider: the uncertainties follow. In the middle is what the study states.").classes(
            "quiet"
        )
        with ui.element("div").classes("w-full grid grid-cols-1 md:grid-cols-2 gap-6"):
            self.levers = ui.element("div").classes("w-full")
            self.numbers = ui.element("div").classes("w-full md:sticky md:top-2 self-start")
        heading("A better plan" if self.plan.ending else "Layouts side by side")
        button("Search" if self.plan.ending else "Compare", self.search)
        self.same = ui.element("div").classes("w-full")
        self.found = ui.element("div").classes("w-full")
        job = bench.last_design(session)
        if job is not None:
            self.follow(job)

    def _plan(self) -> None:
        """The plan as lines, and plans by their name."""
        heading("The plan")
        if self.plans:
            names = list(self.plans)
            ui.select(names, label="Begin with", on_change=lambda event: self.named(event.value)).classes(
                "w-full"
            )
        self.lines = ui.textarea(on_change=lambda event: self.typed(event.value))
        self.lines.props('outlined debounce=300 aria-label="plan, a line each" input-style="height: 19rem"')
        self.lines.classes("w-full command")
        ui.label(f"A line each: {self.plan.says}. What is typed is written into the study.").classes(
            "quiet text-sm"
        )

    async def named(self, name: str) -> None:
        """Take a plan by its name."""
        with told():
            await self.write(with_keys(self.text, self.plans[name]))

    async def typed(self, lines: str) -> None:
        """The lines were changed: so is the study."""
        if lines == self.shown:
            return
        try:
            await self.write(with_lines(self.plan, self.text, lines), lines)
        except InercalError as error:
            self.say(str(error), False)

    async def write(self, text: str, lines: str | None = None) -> None:
        """Write the study with another plan, and judge it."""
        put(self.session, STUDY, text)
        self.text = text
        await self.judge(lines)

    shown = ""
    """The lines as they are shown."""

    async def judge(self, lines: str | None = None) -> None:
        """Show what the plan makes expect; ``lines`` were typed, and stay as they are."""
        try:
            study, foresight, up = await asyncio.to_thread(self.bench.foreseen, self.session)
            drawn = await asyncio.to_thread(_stops, up) if len(up) else ""
        except InercalError as error:
            self.say(str(error), False)
            self.foresight = None
            for each in (self.levers, self.numbers, self.same, self.stops):
                each.clear()
            return
        self.shown = lines_of(study) if lines is None else lines
        self.lines.set_value(self.shown)
        self.foresight, self.factors = foresight, np.ones(len(foresight.levers))
        self.draw(drawn)
        self.table(foresight)
        self.sliders(foresight)
        self.repeat()
        count = f"{len(up)} stops, " if len(up) else ""
        self.say(f"{count}{len(foresight.names)} values are predicted. {foresight.hides}".rstrip(), True)

    def say(self, words: str, good: bool) -> None:
        """The line above all."""
        self.verdict.set_text(words)
        self.verdict.classes(replace="ok" if good else "bad")

    def draw(self, drawn: str) -> None:
        """The picture of the stops, none of a model in motion."""
        self.stops.clear()
        if drawn:
            with self.stops:
                heading("Where up is on the instrument")
                words = "Direction of the vertical on the axes of the instrument at each stop, in their order"
                ui.image(drawn).props(f'alt="{words}" fit=contain').classes("w-full")
                ui.label(f"{words}; two halves of the sphere, seen along −z.").classes("quiet text-sm")

    def table(self, foresight: Foresight) -> None:
        """Uncertainties as stated and now, with the largest source."""
        self.numbers.clear()
        self.before = foresight.u(self.factors)
        made: list[ui.label] = []

        def cell() -> None:
            made.append(ui.label())

        texts = zip(foresight.names, foresight.units, (self.before / foresight.sizes).tolist(), strict=True)
        rows: list[list[str | Callable[[], object]]] = [
            [name, short(u), cell, unit, cell, cell] for name, unit, u in texts
        ]
        with self.numbers:
            table(["Value", "u as stated", "u now", "Unit", "Times", "Mostly from"], rows, {1, 2, 4})
        self.cells = list(zip(made[0::3], made[1::3], made[2::3], strict=True))
        self.show()
        self.share()

    def show(self) -> None:
        """The uncertainties with the sliders as they are."""
        assert self.foresight is not None
        u = self.foresight.u(self.factors)
        for (now, times, _), value, ratio in zip(
            self.cells, (u / self.foresight.sizes).tolist(), (u / self.before).tolist(), strict=True
        ):
            now.set_text(short(value))
            times.set_text(f"{ratio:.2f}")

    def share(self) -> None:
        """The largest source of each uncertainty."""
        assert self.foresight is not None
        shares = self.foresight.shares(self.factors)
        for k, (_, _, source) in enumerate(self.cells):
            first = int(np.argmax(shares[:, k]))
            rest = 1.0 - float(shares[:, k].sum())
            name, part = self.foresight.levers[first].key.rpartition(".")[2], float(shares[first, k])
            if rest > part:
                name, part = "prior and site", rest
            source.set_text(f"{name} {100.0 * part:.0f} %")

    def sliders(self, foresight: Foresight) -> None:
        """A slider for each size that the study states."""
        self.levers.clear()
        with self.levers:
            for k, lever in enumerate(foresight.levers):
                words = ui.label(f"{lever.key}: {lever.quantity()}").classes("text-sm")
                if lever.says:
                    ui.label(lever.says).classes("quiet text-sm")
                slider = ui.element("input").classes("w-full mb-2")
                slider.props(f'type=range min=0 max={_END} step=2 aria-label="{lever.key}"')
                self.follow_slider(slider, words, k)
            button("As stated", lambda: self.judge(self.shown))

    def follow_slider(self, slider: ui.element, words: ui.label, k: int) -> None:
        """Have the uncertainties follow a slider; the shares, when it is let go."""

        def moved(event: events.GenericEventArguments) -> None:
            foresight = self.foresight
            if foresight is None or k >= len(self.factors):
                return
            factor = float(10.0 ** (float(event.args) / _MIDDLE - 1.0))
            self.factors[k] = factor
            lever = foresight.levers[k]
            times = "" if factor == 1.0 else f" ({factor:.2g} times)"
            words.set_text(f"{lever.key}: {lever.quantity(factor)}{times}")
            self.show()

        def released() -> None:
            if self.foresight is not None:
                self.share()
                self.repeat()

        slider.on("input", moved, throttle=0.05, js_handler="(event) => emit(event.target.value)")
        slider.on("change", released)

    def settings(self) -> list[str]:
        """The sizes that sliders set, as ``--set`` takes it."""
        assert self.foresight is not None
        pairs = zip(self.foresight.levers, self.factors.tolist(), strict=True)
        return [lever.setting(factor) for lever, factor in pairs if abs(factor - 1.0) > 1e-9]

    def repeat(self) -> None:
        """The command that judges and searches with the same sizes."""
        self.same.clear()
        sets = [word for each in self.settings() for word in ("--set", each)]
        out = ["--out", f"plan{self.plan.ending}"] if self.plan.ending else []
        with self.same:
            words = ["inercal", "design", self.plan.design, STUDY, *sets, *out, "--report", "design.html"]
            command(shlex.join(words))

    def search(self) -> None:
        """Begin the search for a better plan."""
        with told():
            sets = [] if self.foresight is None else self.settings()
            self.follow(self.bench.design(self.session, sets))

    def follow(self, job: Job) -> None:
        """The state of a search, and what it found."""
        self.found.clear()
        with self.found:
            state = ui.label().props('role="status" data-search="1"')
            place = ui.element("div").classes("w-full")
        plan = job.folder / f"plan{self.plan.ending}"

        def ended(now: Job) -> None:
            if now.said.strip() and now.state is not JobState.DONE:
                refused(InercalError(now.said.strip()))
            if self.plan.ending and plan.is_file():
                button("Take the plan found", lambda: self.take(plan.read_text()), main=True)

        what = f"The {'search' if self.plan.ending else 'comparison'} (job {job.id})"
        with self.found:
            followed(self.bench, job, state, what, "search for a plan", place, ended)

    async def take(self, found: str) -> None:
        """Write the plan found into the study."""
        with told():
            await self.write(with_found(self.plan, self.text, found))
            ui.notify("The plan found is in the study.", type="positive")


def _stops(up: Array) -> str:
    """The address of a picture of verticals (r, 3) on the instrument."""
    with _DRAWING:
        return draw("Stops", "", [hemispheres(up)], 3.4).uri
