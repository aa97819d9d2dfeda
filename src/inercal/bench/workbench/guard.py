"""The guard before the workbench: lets in requests of its own pages and of programs that know the key.

A page of somebody else in the same browser can send requests to this machine, and by a name that changes its address
even read the answers (DNS rebinding). So the host must be this machine by number or name, the origin the workbench
itself, and the key must be there: in a cookie of the browser that opened the address with the key, or as a bearer
token. It holds for pages, REST and websockets alike.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import re
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

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

REPORT_POLICY = (
    "sandbox allow-scripts allow-popups; default-src 'none'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; img-src data:; font-src data:"
)
"""Of a report, which may hold names from a foreign file: alone in its frame, without any request."""

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
