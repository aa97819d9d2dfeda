"""Addresses of sources and sinks: texts parsed once into frozen ends."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, TypeVar
from urllib.parse import parse_qsl, unquote

from inercal.foundation.errors import InputError
from inercal.foundation.units import shown

SOURCES = (
    "serial:/dev/ttyUSB0?baud=921600",
    "udp://127.0.0.1:5005",
    "tcp://host:5006",
    "mqtt://host/topic",
    "mqtts://host/topic",
    "replay:FILE?speed=1",
)
"""An example of each address of a source."""

SINKS = (
    "text:FILE",
    "text:-",
    "parquet:FOLDER",
    "hdf5:FOLDER",
    "udp://127.0.0.1:5007",
    "mqtt://host/topic",
    "mqtts://host/topic",
)
"""An example of each address of a sink."""

LARGEST_BAUD = 12_000_000
LARGEST_SPEED = 1e6


@dataclass(frozen=True)
class SerialPort:
    """A serial port, 8 bits, no parity, 1 stop bit."""

    device: str
    baud: int

    def __str__(self) -> str:
        return f"serial:{self.device}"


@dataclass(frozen=True)
class Udp:
    """Datagrams, received at or sent to a host and port."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udp://{bracketed(self.host)}:{self.port}"


@dataclass(frozen=True)
class Tcp:
    """A server that sends bytes to whoever connects."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp://{bracketed(self.host)}:{self.port}"


@dataclass(frozen=True)
class Mqtt:
    """A topic of a broker, by MQTT ``version`` "3.1.1" or "5"; with TLS, ``ca`` is the file of certificates to trust
    where the system's are not meant. ``login`` is a file of two lines, user and password."""

    host: str
    port: int
    topic: str
    tls: bool = False
    version: str = "5"
    ca: Path | None = None
    login: Path | None = None

    def __str__(self) -> str:
        return f"{'mqtts' if self.tls else 'mqtt'}://{bracketed(self.host)}:{self.port}/{self.topic}"


@dataclass(frozen=True)
class Replay:
    """A recording played again; ``speed`` 1 is that of its time stamps, 0 as fast as it goes."""

    file: Path
    speed: float

    def __str__(self) -> str:
        return f"replay:{self.file}"


@dataclass(frozen=True)
class Text:
    """Lines of text into a file; None for standard output."""

    file: Path | None

    def __str__(self) -> str:
        return f"text:{self.file or '-'}"


@dataclass(frozen=True)
class PieceFolder:
    """A folder of files, each of which holds the rows of some seconds."""

    folder: Path
    form: Literal["parquet", "hdf5"]

    def __str__(self) -> str:
        return f"{self.form}:{self.folder}"


Source = SerialPort | Udp | Tcp | Mqtt | Replay
Sink = Text | PieceFolder | Udp | Mqtt


A = TypeVar("A", bound=Source | Sink)


def placed(address: A, read: Callable[[Path], Path], written: Callable[[Path], Path]) -> A:
    """The address with its files where they lie: of those that are ``read``, and of the one that is ``written``."""
    paths = {each.name: getattr(address, each.name) for each in fields(address)}
    lies = written if isinstance(address, Text | PieceFolder) else read
    moved: dict[str, Any] = {name: lies(path) for name, path in paths.items() if isinstance(path, Path)}
    return replace(address, **moved)


def target(sink: Sink) -> Path | None:
    """The file or folder that a sink writes, None where it writes none."""
    return sink.file if isinstance(sink, Text) else sink.folder if isinstance(sink, PieceFolder) else None


def source_of(text: str) -> Source:
    """The source of an address; raises `InputError`."""
    scheme, rest, keys = _parts(text, SOURCES)
    source: Source
    match scheme:
        case "serial":
            baud = _number(keys, "baud", text, 1, LARGEST_BAUD, "115200")
            source = SerialPort(_named(rest, text, "serial:/dev/ttyUSB0"), int(baud))
        case "replay":
            speed = _number(keys, "speed", text, 0.0, LARGEST_SPEED, "1")
            source = Replay(Path(_named(rest, text, "replay:FILE")), speed)
        case "udp":
            source = Udp(*_host_and_port(rest, text, None))
        case "tcp":
            source = Tcp(*_host_and_port(rest, text, None))
        case "mqtt" | "mqtts":
            source = _mqtt(scheme, rest, keys, text)
        case _:
            raise _unknown(text, scheme, SOURCES)
    _refuse_rest(keys, text)
    return source


def sink_of(text: str) -> Sink:
    """The sink of an address; raises `InputError`."""
    scheme, rest, keys = _parts(text, SINKS)
    sink: Sink
    match scheme:
        case "text":
            name = _named(rest, text, "text:FILE")
            sink = Text(None if name == "-" else Path(name))
        case "parquet":
            sink = PieceFolder(Path(_named(rest, text, "parquet:FOLDER")), "parquet")
        case "hdf5":
            sink = PieceFolder(Path(_named(rest, text, "hdf5:FOLDER")), "hdf5")
        case "udp":
            sink = Udp(*_host_and_port(rest, text, None))
        case "mqtt" | "mqtts":
            sink = _mqtt(scheme, rest, keys, text)
        case _:
            raise _unknown(text, scheme, SINKS)
    _refuse_rest(keys, text)
    return sink


def bracketed(host: str) -> str:
    """A host as an address has it: in brackets where it has colons."""
    return f"[{host}]" if ":" in host else host


def _parts(text: str, examples: tuple[str, ...]) -> tuple[str, str, dict[str, str]]:
    """Scheme, what follows it, and the keys behind ``?``."""
    if not text.isprintable() or len(text) > 1000:
        raise InputError("address", f"found {shown(text)}, expected one such as {', '.join(examples)}")
    if re.match(r"[^?#]*://[^/?#]*@", text):
        raise InputError(
            "address",
            "found a user or password in it, expected them in INERCAL_MQTT_USER and INERCAL_MQTT_PASSWORD, or in "
            "a file named by ?login=FILE",
        )
    scheme, colon, rest = text.partition(":")
    if not colon:
        raise _unknown(text, scheme, examples)
    rest, _, query = rest.partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    keys = dict(pairs)
    if len(keys) < len(pairs):
        raise InputError(shown(text), "found a key twice, expected each once")
    return scheme.lower(), rest, keys


def _unknown(text: str, scheme: str, examples: tuple[str, ...]) -> InputError:
    """The refusal of an address of no known kind."""
    return InputError(
        shown(text), f"found no known kind of address, expected one such as {', '.join(examples)}"
    )


def _refuse_rest(keys: Mapping[str, str], text: str) -> None:
    """Refuse keys that nobody asked for."""
    for key in keys:
        raise InputError(shown(text), f"found the key {shown(key)}, which this kind of address does not have")


def _named(rest: str, text: str, example: str) -> str:
    """The name of a device, file or folder."""
    name = unquote(rest)
    if not name or not name.isprintable() or name.startswith("//"):
        raise InputError(shown(text), f"found no name, expected an address such as {example}")
    return name


def _number(keys: dict[str, str], key: str, text: str, least: float, largest: float, absent: str) -> float:
    """The number of a key, which is taken out."""
    given = keys.pop(key, absent)
    if not re.fullmatch(r"\d{1,9}(?:\.\d{1,6})?", given) or not least <= float(given) <= largest:
        raise InputError(
            shown(text), f"found {key}={shown(given)}, expected a number from {least:g} to {largest:g}"
        )
    return float(given)


def _host_and_port(rest: str, text: str, port: int | None) -> tuple[str, int]:
    """Host and port of ``//host:port``; ``port`` where none is given."""
    match = re.fullmatch(
        r"//(?:\[([0-9A-Fa-f:.]+)\]|([A-Za-z0-9_-]{1,63}(?:\.[A-Za-z0-9_-]{1,63})*))(?::(\d{1,5}))?/?", rest
    )
    number = port if match is None or match[3] is None else int(match[3])
    if match is None or number is None or not 1 <= number <= 65535:
        raise InputError(shown(text), "found no host and port, expected them as in udp://127.0.0.1:5005")
    return match[1] or match[2], number


def _mqtt(scheme: str, rest: str, keys: dict[str, str], text: str) -> Mqtt:
    """A topic of a broker."""
    tls = scheme == "mqtts"
    host, slash, topic = rest.removeprefix("//").partition("/")
    topic = unquote(topic)
    if not rest.startswith("//") or not slash or not topic or not topic.isprintable() or len(topic) > 500:
        raise InputError(shown(text), "found no topic, expected one as in mqtt://host/topic")
    if set(topic) & set("+#"):
        raise InputError(shown(text), "found + or # in the topic, expected one topic alone")
    version = keys.pop("version", "5")
    if version not in ("5", "3.1.1"):
        raise InputError(shown(text), f"found version={shown(version)}, expected 5 or 3.1.1")
    ca, login = (Path(keys.pop(key)) if keys.get(key) else None for key in ("ca", "login"))
    if ca is not None and not tls:
        raise InputError(shown(text), "found ca with mqtt, expected mqtts")
    where = _host_and_port(f"//{host}", text, 8883 if tls else 1883)
    return Mqtt(*where, topic, tls, version, ca, login)
