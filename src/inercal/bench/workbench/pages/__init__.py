"""Pages of the workbench, a module each; none computes anything."""

from __future__ import annotations

from inercal.bench.workbench.bench import Bench


def add_pages(bench: Bench) -> None:
    """Make the pages known to NiceGUI."""
    from nicegui import app

    from inercal.bench.workbench.pages import (
        design,
        home,
        instruments,
        live,
        recording,
        result,
        run,
        study,
    )
    from inercal.bench.workbench.pages.frame import framed, refused

    def failed(error: Exception) -> None:
        with framed("Not to be shown"):
            refused(error)

    app.on_page_exception(failed)
    for page in (home, recording, study, design, run, result, live, instruments):
        page.add(bench)
