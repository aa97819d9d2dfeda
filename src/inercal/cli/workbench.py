"""``inercal workbench``."""

from __future__ import annotations

import getpass
import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import OutputOptions, StoreOption
from inercal.cli.outcome import timed
from inercal.foundation.errors import InputError

_PASSWORD = "INERCAL_WORKBENCH_PASSWORD"
"""Variable of the environment that holds the password for other machines."""


def workbench(
    folder: Annotated[
        Path | None, Parameter(help="Work folder, for sessions and jobs; the user's own if absent.")
    ] = None,
    /,
    *,
    port: Annotated[int, Parameter(help="Port to listen at; a free one if 0.")] = 0,
    host: Annotated[
        str,
        Parameter(
            help="Address to listen at. Beyond this machine a password is asked for, and whoever is on the network "
            "can read what is sent."
        ),
    ] = "127.0.0.1",
    browser: Annotated[bool, Parameter(name="--no-browser", negative="", help="Open no browser.")] = False,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),  # noqa: B008  (frozen)
) -> None:
    """Serve the workbench until it is asked to end."""
    from platformdirs import user_data_path

    from inercal.bench.workbench.bench import open_bench
    from inercal.bench.workbench.serve import HERE, Door, serve
    from inercal.foundation.results.files import to_json
    from inercal.foundation.results.result import without_coefficients

    if not 0 <= port <= 65535:
        raise InputError("--port", f"found {port}, expected a number from 0 to 65535")
    password = "" if host == HERE else _password(host)
    root = folder or user_data_path("inercal", appauthor=False) / "workbench"
    bench = open_bench(root.absolute(), store)

    def tell(address: str) -> None:
        words = f"inercal workbench: {address}"
        found = to_json(timed(without_coefficients("workbench", words, {})))
        output.emit(
            {**found, "result": {"address": address}}, words
        )  # with its key, which is meant for the reader

    try:
        serve(bench, Door(host, port, password), tell, not browser)
    finally:
        bench.close()


def _password(host: str) -> str:
    """The password that browsers of other machines need; raises `InputError` for one of fewer than 12 characters."""
    given = os.environ.get(_PASSWORD)
    if given is None and sys.stdin is not None and sys.stdin.isatty():
        print(
            f"The workbench will be reachable at {host}: without encryption, by all who know this password."
        )
        given = getpass.getpass("Password: ")
    if not given or len(given) < 12:
        raise InputError(
            "--host", f"needs a password of 12 characters or more, at the prompt or in {_PASSWORD}"
        )
    return given
