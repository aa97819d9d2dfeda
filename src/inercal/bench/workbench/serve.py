"""The workbench as a server on this machine: its pages, REST beside them, the guard before both.

A page of somebody else in the same browser can send requests to this machine, and by a name that changes its address
even read the answers (DNS rebinding). So the guard lets in a request only if the host is this machine by number or
name, the origin is the workbench itself, and the key is there: in a cookie of the browser that opened the address with
the key, or as a bearer token. That holds for pages, REST and websockets alike.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import re
import secrets
import socket
import threading
import webbrowser
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

from inercal.bench.workbench.bench import Bench
from inercal.foundation.errors import InputError, MissingExtraError

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LARGEST_BODY = 1024**2
"""Bytes of a request that is no upload."""

POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; frame-src 'self'; object-src 'none'; "
    "base-uri 'self'; form-action 'self'; frame-ancestors 'self'"
)
"""Nothing from outside: the libraries of the pages write scripts and styles into the page, hence "unsafe"."""

_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)

_LOGIN = """<!doctype html><html lang="en"><meta charset="utf-8"><title>inercal workbench</title>
<body style="font-family: sans-serif; margin: 4rem auto; max-width: 30rem"><h1>inercal workbench</h1><p>{words}</p>
{form}</body></html>"""
_FORM = """<form method="post" action="/login"><label>Password <input type="password" name="password" autofocus
autocomplete="current-password"></label> <button>Open</button></form>"""


@dataclass(frozen=True)
class AccessKey:
    """The secret of one run of the workbench, and the password that gives it to a browser; empty without one."""

    secret: str
    password: str = ""

    @property
    def cookie(self) -> str:
        """Name of the cookie that holds the secret: cookies of a machine are not told apart by port."""
        return f"inercal_{_digest(self.secret).hex()[:8]}"

    def is_secret(self, given: str) -> bool:
        """True for the secret; takes as long for any other text."""
        return hmac.compare_digest(given.encode(), self.secret.encode())

    def is_password(self, given: str) -> bool:
        """True if a text is the password of the workbench."""
        same = hmac.compare_digest(_digest(given), _digest(self.password))
        return bool(self.password) and same


def _digest(text: str) -> bytes:
    """A text as bytes of one length."""
    return hashlib.sha256(text.encode(errors="surrogatepass")).digest()


@dataclass(frozen=True)
class Guard:
    """An ASGI application before another: refuses what is not for it, and adds headers to answers.

    ``names`` are host names of this machine; a host that is an IP address is accepted beside them, since no name of
    somebody else's can lead there.
    """

    app: App
    key: AccessKey
    names: frozenset[str]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        headers = {
            name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]
        }
        host = headers.get("host", "")
        if not self._is_here(host):
            await _refuse(scope, send, 421, "This is not the host of the workbench.")
        elif not _same_origin(headers.get("origin"), host):
            await _refuse(scope, send, 403, "The workbench answers its own pages only.")
        elif scope["path"] == "/login" and scope["type"] == "http":
            await self._log_in(scope, receive, send)
        elif not self._knows_key(headers):
            await self._without_key(scope, send)
        else:
            await self.app(scope, _limited(receive, scope), _with_headers(send))

    def _is_here(self, host: str) -> bool:
        """True if the host of a request is this machine."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in self.names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def _knows_key(self, headers: Mapping[str, str]) -> bool:
        """True where the key comes with a request."""
        scheme, _, token = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            return self.key.is_secret(token.strip())
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self.key.cookie)
        except CookieError:
            return False
        return cookie is not None and self.key.is_secret(cookie.value)

    async def _without_key(self, scope: Scope, send: Send) -> None:
        """Take the key from the address, else ask for it."""
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        asks = scope["type"] == "http" and scope["method"] == "GET"
        if asks and self.key.is_secret(query.get("key", [""])[0]):
            rest = urlencode({name: values[0] for name, values in query.items() if name != "key"})
            await self._admit(send, scope["path"] + (f"?{rest}" if rest else ""))
        elif self.key.password:
            await _refuse(scope, send, 401, "", _FORM)
        else:
            await _refuse(
                scope, send, 401, "Open the address that <code>inercal workbench</code> has printed."
            )

    async def _log_in(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Give the key for the password."""
        if scope["method"] != "POST":
            await _refuse(scope, send, 401, "", _FORM if self.key.password else "")
            return
        body, limited = b"", _limited(receive, scope)
        while True:
            message = await limited()
            body += message.get("body", b"")
            if message["type"] == "http.disconnect" or not message.get("more_body"):
                break
        given = parse_qs(body.decode("utf-8", "replace")).get("password", [""])[0]
        if self.key.is_password(given):
            await self._admit(send, "/")
        else:
            await _refuse(scope, send, 401, "That is not the password.", _FORM)

    async def _admit(self, send: Send, path: str) -> None:
        """Give the key to the browser as a cookie, and go on without it in the address."""
        cookie = f"{self.key.cookie}={self.key.secret}; Path=/; HttpOnly; SameSite=Strict"
        target = "/" + path.lstrip("/\\")  # never another host
        head = [
            (b"location", target.encode()),
            (b"set-cookie", cookie.encode()),
            (b"cache-control", b"no-store"),
        ]
        await send({"type": "http.response.start", "status": 303, "headers": [*head, *_HEADERS]})
        await send({"type": "http.response.body", "body": b""})


def _same_origin(origin: str | None, host: str) -> bool:
    """True where no origin is told, or it is the host of the request."""
    if origin is None:
        return True
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and parts.netloc == host


async def _refuse(scope: Scope, send: Send, status: int, words: str, form: str = "") -> None:
    """Answer with a page that says why not; a websocket is closed."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    body = _LOGIN.format(words=words, form=form).encode()
    head = [(b"content-type", b"text/html; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    head += [(b"content-security-policy", POLICY.encode()), (b"cache-control", b"no-store")]
    await send({"type": "http.response.start", "status": status, "headers": [*head, *_HEADERS]})
    await send({"type": "http.response.body", "body": body})


def _limited(receive: Receive, scope: Scope) -> Receive:
    """Receive a body no larger than `LARGEST_BODY`, but for uploads to a session, which count themselves."""
    upload = re.match(r"/api/v1/sessions/\d+/files/", scope.get("path", ""))
    if scope["type"] != "http" or (scope["method"] == "PUT" and upload):
        return receive
    count = 0

    async def counted() -> Message:
        nonlocal count
        message = await receive()
        count += len(message.get("body", b""))
        if count > LARGEST_BODY:
            return {"type": "http.disconnect"}
        return message

    return counted


def _with_headers(send: Send) -> Send:
    """Send answers with the headers that keep a page to this machine, where the answer has none of its own."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = {name.lower() for name, _ in message["headers"]}
            more = [*_HEADERS, (b"content-security-policy", POLICY.encode())]
            message["headers"] = [*message["headers"], *(each for each in more if each[0] not in own)]
        await send(message)

    return sent


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
