"""Addresses as they may be shown, kept and handed out: without the passwords, keys and tokens in them.

Everything that leaves the program passes here: words of errors, results, command lines, pages, the store. An address is
``scheme://login@host/path?key=value``, also several in a chain of fsspec (``simplecache::https://...``). ``***`` stands
for what is hidden: the password of a login, the whole login where it may be a key itself (``s3://KEY:SECRET@bucket``,
``https://TOKEN@host``), and each value of the query whose key is not one of `PLAIN`. In doubt too much is hidden.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import zip_longest
from urllib.parse import unquote, unquote_plus

HIDDEN = "***"
"""The text in the place of a secret."""

PLAIN = frozenset(
    (
        *("baud", "ca", "login", "speed", "version"),  # of wires
        *(
            "application_name",
            "connect_timeout",
            "dbname",
            "host",
            "passfile",
            "port",
            "schema",
            "service",
            "user",
        ),
        *("sslcert", "sslmode", "sslrootcert", "target_session_attrs"),
        *("id", "lang", "no", "page", "region", "unit", "versionid"),
    )
)
"""Keys of queries whose values hold no secret: numbers, names, and files that hold one."""

_DATABASES = frozenset(("mariadb", "mssql", "mysql", "oracle", "postgres", "postgresql"))
_NAMED = _DATABASES | {"ftp", "sftp", "smb", "ssh"}
"""Schemes whose login is the name of a user, which may be shown."""

_LOCAL = frozenset(("file", "hdf5", "local", "parquet", "replay", "serial", "sqlite", "text"))
"""Schemes of what is on this machine: without login, unless two slashes lead to one."""

# One slash is enough behind a longer word: paths of the system make one of two.
_SCHEME = r"(?:[A-Za-z][A-Za-z0-9+.-]*:/{2,}|[A-Za-z][A-Za-z0-9+.-]+:/)"
_IN_TEXT = re.compile(rf"(?:^|(?<=[\s\"'(\[{{<>`])|(?<=::)|(?<=[\w\]]=)){_SCHEME}")
_WHOLE = re.compile(rf"(?:^(?:[\w.-]+=)?|(?<=::)){_SCHEME}")
_WORD = re.compile(r"[^\s\"'<>]*")
_PORT = re.compile(r"(?:\[[^\]]*\]|[^:]*)(?::(?:\d{0,5}|PORT|\*\*\*))?[.,:;)\]}\s]*")
_ASSIGNED = re.compile(
    r"(?i)(?<![\w-])([\w-]*(?:(pass(?:word|wd|phrase)|pwd)|secret|token|access_?key|api_?key|sessionid)\s*=\s*)"
    r"(\"[^\"]*\"|'[^']*'|[^\s=\"'][^\s\"']*)"
)


def without_secrets(text: str) -> str:
    """The text with the secrets of all addresses in it hidden, and those of ``password=...``."""
    return _without(text, whole=False)


def shown_address(text: str) -> str:
    """One address, or an option with one (``--store=...``), with its secrets hidden, spaces and quotes among them."""
    return _without(_without(text, whole=True), whole=False)


def holds_secret(address: str) -> bool:
    """True if an address has a secret in it."""
    return shown_address(address) != address


def hidden_in(text: str, address: str) -> str:
    """Words of a driver or server on an address, with the secrets of that address hidden, however it spells them."""
    for secret in sorted(secrets_in(address), key=len, reverse=True):
        text = text.replace(secret, HIDDEN)
    return without_secrets(text)


def secrets_in(address: str) -> set[str]:
    """The secrets of an address, as they stand and decoded; none of fewer than three characters, which words hold."""
    found: set[str] = set()
    for scheme, rest in _addresses(address):
        login, _, tail = _divided(scheme, rest, whole=True)
        user, _, password = login.partition(":")
        found |= {password} if _named(scheme) else {login, user, password}
        parameters, _ = _query(tail, whole=True)
        found |= {value for key, value in parameters if key.lower() not in PLAIN}
    return {
        each
        for text in found
        for each in (text, unquote(text), unquote_plus(text))
        if len(each.strip("*")) > 2
    }


def without_login(address: str) -> str:
    """An address as it can be used where the secrets come from elsewhere: without its login and its query."""
    (scheme, rest), *_ = [*_addresses(address), ("", address)]
    _, _, tail = _divided(scheme, rest, whole=True) if scheme else ("", "", rest)
    return f"{scheme}{re.split('[?#]', tail, maxsplit=1)[0]}"


def _without(text: str, whole: bool) -> str:
    """The text with secrets hidden; ``whole``: it is one address, else each word may be one."""
    if ":/" in text:
        text = "".join(_pieces(text, whole))
    return _ASSIGNED.sub(_unassigned, text) if "=" in text else text


def _unassigned(match: re.Match[str]) -> str:
    """``password=...`` without its value; a ``token=...`` that is a folder of a path stays."""
    path = match[2] is None and "/" in match[3]
    return match[0] if path else f"{match[1]}{HIDDEN}"


def _pieces(text: str, whole: bool) -> Iterator[str]:
    """The text in pieces, those of addresses with their secrets hidden."""
    begin = 0
    for match, end in _spans(text, whole):
        yield text[begin : match.end()]
        yield _hidden(match[0], text[match.end() : end], whole)
        begin = end
    yield text[begin:]


def _addresses(text: str) -> Iterator[tuple[str, str]]:
    """The scheme of each address of a chain, and the rest of that address."""
    for match, end in _spans(text, whole=True):
        yield match[0], text[match.end() : end]


def _spans(text: str, whole: bool) -> Iterator[tuple[re.Match[str], int]]:
    """Matches of the schemes in a text, and the end of each address."""
    schemes = list((_WHOLE if whole else _IN_TEXT).finditer(text))
    if not whole:  # behind = of a query the address goes on
        schemes = [match for match in schemes if not _is_in_query(text, match.start())]
    for match, following in zip_longest(schemes, schemes[1:]):
        yield match, len(text) if following is None else following.start()


def _is_in_query(text: str, start: int) -> bool:
    """True for a place behind ``=`` within a word that is an address already."""
    return (
        text[start - 1 : start] == "="
        and "://" in re.split(r"[\s\"']", text[max(start - 500, 0) : start])[-1]
    )


def _named(scheme: str) -> bool:
    """True if the login of that scheme is the name of a user."""
    return _kind(scheme) in _NAMED


def _kind(scheme: str) -> str:
    """The kind of a scheme: ``postgresql`` of ``postgresql+psycopg://``."""
    return re.split(r"[+:]", scheme.lower().rpartition("=")[2])[0]


def _hidden(scheme: str, rest: str, whole: bool) -> str:
    """The rest of an address behind its scheme, its secrets hidden."""
    login, at, tail = _divided(scheme, rest, whole)
    if login:
        user, colon, _ = login.partition(":")
        login = HIDDEN if at and not _named(scheme) else f"{user}:{HIDDEN}" if colon else user
    parameters, after = _query(tail, whole)
    if not parameters:
        return login + at + tail
    begin = re.split(r"[?#]", tail, maxsplit=1)[0]
    mark = tail[len(begin)]
    told = [f"{key}={HIDDEN if value and key.lower() not in PLAIN else value}" if key else HIDDEN
            for key, value in parameters]  # fmt: skip
    return f"{login}{at}{begin}{mark}{'&'.join(told)}{after}"


def _divided(scheme: str, rest: str, whole: bool) -> tuple[str, str, str]:
    """Login, ``@`` and what follows, of what comes after a scheme; no login is empty, and there is no ``@`` where the
    address ends before it.

    A password may hold any character, typed as it is: where the port is no number, the login goes on to the last ``@``.
    """
    word = rest if whole else _word(rest)
    host = re.split(r"[/?#\\]", word, maxsplit=1)[0]
    if _kind(scheme) in _LOCAL and (scheme.count("/") != 2 or "@" not in host):
        return "", "", rest
    end = -1
    if "@" in host:
        end = (word if ":" in host else host).split("?")[0].rfind("@")
    elif not _PORT.fullmatch(host):
        end = rest.split("\n")[0].rfind("@")
        if end < 0:  # cut off, as a long word in a message is
            return word, "", rest[len(word) :]
    elif host and _kind(scheme) in _DATABASES and ":" in host:  # as SQLAlchemy reads it
        end = word.rfind("@")
    return ("", "", rest) if end < 0 else (rest[:end], "@", rest[end + 1 :])


def _word(rest: str) -> str:
    """The first word of a text."""
    match = _WORD.match(rest)
    return "" if match is None else match[0]


def _query(tail: str, whole: bool) -> tuple[list[tuple[str, str]], str]:
    """Keys and values of a query (a key is empty where a value stands alone), and the text after it."""
    word = tail if whole else _word(tail)
    parts = re.split(r"[?#]", word, maxsplit=1)
    if len(parts) < 2 or (word[len(parts[0])] == "#" and "=" not in parts[1]):
        return [], ""
    query = parts[1] if whole else parts[1].rstrip(".,:;)]}")
    if not query:
        return [], ""
    after = tail[len(parts[0]) + 1 + len(query) :]
    pairs = [each.partition("=") for each in re.split("[&;]", query) if each]
    return [(key, value) if equals else ("", key) for key, equals, value in pairs], after
