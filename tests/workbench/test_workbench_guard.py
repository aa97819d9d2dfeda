"""The guard lets its own pages and holders of the key through, and nobody else: hosts, origins, keys, sizes."""

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.bench.workbench.serve import LARGEST_BODY, POLICY, AccessKey, Guard

HERE, SECRET = "127.0.0.1:8000", "s3cret-of-this-run"


async def inner(scope, receive, send):
    """The application behind: answers with the size of the body."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    size = 0
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            size = -1
            break
        size += len(message["body"])
        if not message["more_body"]:
            break
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": str(size).encode()})


def asked(path="/", host=HERE, method="GET", kind="http", query=b"", pieces=(b"",), password="", **headers):
    """The messages that answer a request."""
    told = [(b"host", host.encode("latin-1"))]
    told += [(name.replace("_", "-").encode(), value.encode("latin-1")) for name, value in headers.items()]
    scope = {"type": kind, "path": path, "method": method, "query_string": query, "headers": told}
    waiting = [
        {"type": "http.request", "body": piece, "more_body": k + 1 < len(pieces)}
        for k, piece in enumerate(pieces)
    ]
    sent = []

    async def receive():
        return waiting.pop(0)

    async def send(message):
        sent.append(message)

    guard = Guard(inner, AccessKey(SECRET, password), frozenset({"localhost"}))
    asyncio.run(guard(scope, receive, send))
    return sent


def status(messages):
    return messages[0]["status"]


def head(messages, name):
    return dict(messages[0]["headers"]).get(name)


BEARER = {"authorization": f"Bearer {SECRET}"}


def test_the_key_opens_as_a_bearer_token_or_a_cookie():
    cookie = AccessKey(SECRET).cookie
    assert status(asked(**BEARER)) == 200
    assert status(asked(cookie=f"other=1; {cookie}={SECRET}")) == 200
    assert status(asked(cookie=f"{cookie}=wrong")) == 401
    assert status(asked()) == 401


def test_the_key_in_the_address_becomes_a_cookie_and_leaves_the_address():
    answer = asked("/sessions/0001/run", query=f"key={SECRET}&new=1".encode())
    assert status(answer) == 303
    assert head(answer, b"location") == b"/sessions/0001/run?new=1"
    cookie = head(answer, b"set-cookie").decode()
    assert cookie.startswith(f"{AccessKey(SECRET).cookie}={SECRET};")
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie


@pytest.mark.parametrize("path", ["//evil.example/", "/\\evil.example", "///evil.example"])
def test_the_way_on_never_leads_to_another_host(path):
    where = head(asked(path, query=f"key={SECRET}".encode()), b"location")
    assert where == b"/evil.example" + (b"/" if path == "//evil.example/" else b"")


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example:8000", "", "[::1"]
)
def test_a_host_that_is_not_this_machine_is_refused_with_the_key_too(host):
    assert status(asked(host=host, **BEARER)) == 421


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:8000", "[::1]:8000", "192.168.0.7"])
def test_this_machine_by_number_or_name_is_answered(host):
    assert status(asked(host=host, **BEARER)) == 200


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", f"http://{HERE}.evil.example", "http://127.0.0.1:9999"]
)
def test_a_foreign_origin_is_refused_on_pages_and_websockets(origin):
    assert status(asked(origin=origin, **BEARER)) == 403
    assert asked(kind="websocket", origin=origin, **BEARER) == [{"type": "websocket.close", "code": 1008}]


def test_a_websocket_needs_the_key():
    assert asked(kind="websocket", origin=f"http://{HERE}")[0]["type"] == "websocket.close"
    assert asked(kind="websocket", origin=f"http://{HERE}", **BEARER)[0]["type"] == "websocket.accept"


def test_the_password_gives_the_key_and_nothing_else_does():
    right = asked(
        "/login", method="POST", pieces=(b"password=a+long+pass", b"word"), password="a long password"
    )
    assert status(right) == 303
    assert SECRET in head(right, b"set-cookie").decode()
    for typed, password in ((b"password=wrong", "a long password"), (b"password=", ""), (b"", "")):
        refused = asked("/login", method="POST", pieces=(typed,), password=password)
        assert status(refused) == 401
        assert head(refused, b"set-cookie") is None


def test_a_long_body_ends_and_an_upload_does_not():
    pieces = (b"x" * (LARGEST_BODY // 2),) * 3
    assert asked(method="POST", pieces=pieces, **BEARER)[1]["body"] == b"-1"
    assert asked("/api/v1/lab", method="PUT", pieces=pieces, **BEARER)[1]["body"] == b"-1"
    upload = asked("/api/v1/sessions/0001/files/x.csv", method="PUT", pieces=pieces, **BEARER)
    assert upload[1]["body"] == str(3 * (LARGEST_BODY // 2)).encode()


def test_answers_name_no_outside_source():
    answer = asked(**BEARER)
    assert head(answer, b"content-security-policy") == POLICY.encode()
    assert head(answer, b"x-content-type-options") == b"nosniff"
    assert not {"http:", "https:", "ws:", "wss:", "*"} & set(POLICY.replace(";", " ").split())


@given(st.text(max_size=80), st.text(max_size=80))
def test_no_header_of_any_text_opens_or_breaks_it(cookie, authorization):
    texts = {
        name: text.encode("utf-8", "replace").decode("latin-1")
        for name, text in (("cookie", cookie), ("authorization", authorization))
    }
    assert status(asked(**texts)) == 401
