"""The workbench as a server on this machine: its pages, REST beside them, the guard before both."""

from __future__ import annotations

import secrets
import socket
import threading
import webbrowser
from collections.abc import Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.guard import AccessKey, Guard
from inercal.foundation.errors import InputError, MissingExtraError

HERE = "127.0.0.1"
"""Address of this machine that no other reaches."""


@dataclass(frozen=True)
class Door:
    """The door of the workbench: host and port, and the password that other machines need, empty on this one."""

    host: str = HERE
    port: int = 0
    password: str = ""


def application(bench: Bench, key: AccessKey, names: frozenset[str]) -> Any:
    """The ASGI application: guard, REST and pages. Raises `MissingExtraError` without NiceGUI."""
    try:
        from fastapi import FastAPI
        from fastapi.staticfiles import StaticFiles
        from nicegui import ui
    except ImportError as error:
        raise MissingExtraError("the workbench", "workbench") from error
    from inercal.bench.workbench.pages import add_pages
    from inercal.bench.workbench.rest import rest_of

    @asynccontextmanager
    async def life(app: FastAPI) -> Any:
        yield
        bench.close()

    app = FastAPI(lifespan=life, docs_url=None, redoc_url=None, openapi_url=None)
    app.mount("/api/v1", rest_of(bench))
    app.mount("/static", StaticFiles(directory=Path(__file__).parent / "static"))
    add_pages(bench)
    ui.run_with(
        app, title="inercal workbench", dark=None, show_welcome_message=False, favicon=_ICON, language="en-US",
        reconnect_timeout=60.0,  # a machine that is busy keeps the page, and what was being typed on it
    )  # fmt: skip
    return Guard(app, key, names)


_ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32"><circle cx="16" cy="16" r="13" fill="none" '
    'stroke="#4477AA" stroke-width="3"/><ellipse cx="16" cy="16" rx="13" ry="5" fill="none" stroke="#EE8866" '
    'stroke-width="2"/><circle cx="16" cy="16" r="3" fill="#4477AA"/></svg>'
)


def serve(bench: Bench, door: Door, told: Callable[[str], None], browser: bool = True) -> None:
    """Serve until asked to end; ``told`` takes the address with the key.

    Raises `InputError` where the port is taken, `MissingExtraError` without NiceGUI.
    """
    key = AccessKey(secrets.token_urlsafe(32), door.password)
    names = (
        {"localhost", HERE} if door.host == HERE else {"localhost", socket.gethostname(), socket.getfqdn()}
    )
    app = application(bench, key, frozenset(name.lower() for name in names))
    import uvicorn

    try:
        bound = socket.create_server((door.host, door.port))
    except OSError as error:
        raise InputError(f"{door.host}:{door.port}", f"cannot be listened at ({error.strerror})") from error
    with bound:
        host, port = bound.getsockname()[:2]
        shown = HERE if door.host == HERE else socket.gethostname() if host in ("0.0.0.0", "::") else host
        address = f"http://{shown}:{port}/" + ("" if door.password else f"?key={key.secret}")
        told(address)
        if browser:
            threading.Timer(0.5, webbrowser.open, [address]).start()
        config = uvicorn.Config(
            app, log_level="warning", access_log=False, server_header=False, ws="websockets"
        )
        config.ws_max_size = 16 * 1024**2
        uvicorn.Server(config).run(sockets=[bound])
