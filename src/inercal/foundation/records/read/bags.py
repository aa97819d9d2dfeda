"""ROS bags through rosbags: ROS 1 (.bag), ROS 2 (a folder, or .db3) and MCAP.

A column is a field of a topic, ``"/imu/data/linear_acceleration.x"``; the time is a field of it too:
``header.stamp``, or ``time``, when the message was recorded. `sensor_msgs/Imu` is in SI units by definition
(REP 103), so that a bag with one topic of it needs no map.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import MissingExtraError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import Channel
from inercal.foundation.records.places import counted, counted_names, shortened
from inercal.foundation.records.read.arrays import Contents, guarded, held, reason, samples, tables
from inercal.foundation.records.read.child import in_child
from inercal.foundation.records.read.limits import FIELDS, NESTING, size_of
from inercal.foundation.records.read.table import FileOptions, FirstLook, RawTable
from inercal.foundation.units import parse_unit

_IMU = "sensor_msgs/msg/Imu"
_STAMP, _RECORDED = "header.stamp", "time"
_CHANNELS = {
    **{f"acc_{axis}": (f"linear_acceleration.{axis}", "m/s^2") for axis in "xyz"},
    **{f"gyro_{axis}": (f"angular_velocity.{axis}", "rad/s") for axis in "xyz"},
}
_UNITS = {**dict(_CHANNELS.values()), _STAMP: "s", _RECORDED: "s"}
_PEEKED = 20_000
_TOLD = 5_000


@dataclass(frozen=True)
class _Topic:
    """A topic of an open bag: type, connections, number of messages, and the definitions of types in the bag."""

    kind: str
    connections: tuple[Any, ...]
    count: int
    definitions: Mapping[str, Any]

    def content(self, path: str) -> str | None:
        """``number``, ``text``, ``time`` or ``list``, what the field at a path holds; None if there is none such.

        Only the types along the path are looked at: definitions within each other may have fields without number.
        """
        if path == _RECORDED:
            return "time"
        kind, content = self.kind, None
        for name in path.split("."):
            if kind not in self.definitions:
                return None
            node, kind = dict(self.definitions[kind][1]).get(name, (None, ""))
            content = None if node is None else _content(node, kind)
        return content


@dataclass(frozen=True)
class _Bag:
    """An open bag and its topics by name."""

    reader: Any
    topics: Mapping[str, _Topic]

    @property
    def words(self) -> str:
        """The contents of the bag in words."""
        names = [f"{shortened(name)} ({shortened(topic.kind)})" for name, topic in self.topics.items()]
        return f"the topics {counted_names(names, 20)}"

    def place(self, name: str) -> tuple[str, str] | None:
        """Topic and field of ``/imu/data/linear_acceleration.x``; None if there are none such."""
        path = f"/{name.strip('/')}"
        topics = [topic for topic in self.topics if path.startswith(f"/{topic.strip('/')}/")]
        places = [(topic, path[len(topic.strip("/")) + 2 :]) for topic in topics]
        return next((place for place in places if self.topics[place[0]].content(place[1])), None)


def read(
    path: Path,
    options: FileOptions,
    channels: tuple[Channel, ...] | None,
    progress: Callable[[int], None],
) -> list[RawTable]:
    """Read the mapped fields, or those of the only topic of `sensor_msgs/Imu`, in one pass over the messages.

    The stamps of the headers are the clock of a topic, unless all are zero.
    """
    _library()
    return in_child(partial(_read, path, options, channels), path, progress)


def _read(
    path: Path, options: FileOptions, channels: tuple[Channel, ...] | None, progress: Callable[[int], None]
) -> list[RawTable]:
    """As `read`, in a child."""
    with _opened(path) as bag:
        wanted = _imu(bag, path) if channels is None else channels
        names = [each.origin[0] if isinstance(each.origin, tuple) else each.origin for each in wanted]
        places = {place for name in names if isinstance(name, str) and (place := bag.place(name))}
        size = size_of(path)
        contents = _contents(bag, places, path, lambda part: progress(int(part * size)))
        return tables(contents, options, wanted, path, mapped=channels is not None)


def header(path: Path) -> tuple[Channel, ...]:
    """The channels of the only topic of `sensor_msgs/Imu`; raises `RecordError` where there is not one."""
    _library()
    return in_child(partial(_header, path), path)


def _header(path: Path, _: Callable[[int], None]) -> tuple[Channel, ...]:
    """As `header`, in a child."""
    with _opened(path) as bag:
        return _imu(bag, path)


def peek(path: Path) -> list[FirstLook]:
    """Look at the first messages of the topics of `sensor_msgs/Imu`, or of all where there are none."""
    _library()
    return in_child(partial(_peek, path), path)


def _peek(path: Path, _: Callable[[int], None]) -> list[FirstLook]:
    """As `peek`, in a child."""
    with _opened(path) as bag:
        topics = [name for name, topic in bag.topics.items() if topic.kind == _IMU] or list(bag.topics)
        places = {
            (name, each)
            for name in topics
            for each, content in islice(_fields(bag.topics[name].definitions, bag.topics[name].kind), FIELDS)
            if content == "number"
        }
        return samples(_contents(bag, places, path, lambda _: None, _PEEKED), path)


@contextmanager
def _opened(path: Path) -> Iterator[_Bag]:
    """The bag while it is open; errors as `RecordError`."""
    AnyReader, Stores, get_typestore = _library()
    with (
        guarded(path, "a bag"),
        AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader,
    ):
        topics = {}
        for name, topic in reader.topics.items():
            definitions = reader.typestore.fielddefs
            if topic.msgtype in definitions and topic.msgcount:
                topics[name] = _Topic(topic.msgtype, tuple(topic.connections), topic.msgcount, definitions)
        if not topics:
            raise RecordError(path, "found no topic with messages of a known type, expected one at least")
        yield _Bag(reader, topics)


def _library() -> tuple[Any, Any, Any]:
    """The parts of rosbags that are used, its types loaded once for all children; raises `MissingExtraError`."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtraError("Reading bags", "files") from error
    for known in (Stores.LATEST, Stores.ROS1_NOETIC):
        get_typestore(known)
    return AnyReader, Stores, get_typestore


def _fields(
    definitions: Mapping[str, Any], kind: str, above: tuple[str, ...] = ()
) -> Iterator[tuple[str, str]]:
    """Paths of the fields of a message type, and what each holds; what lies deeper than `NESTING` is left out."""
    for name, (node, of) in definitions[kind][1]:
        path = (*above, name)
        if content := _content(node, of):
            yield ".".join(path), content
        elif of in definitions and len(path) < NESTING:
            yield from _fields(definitions, of, path)


def _content(node: Any, of: Any) -> str | None:
    """``number``, ``text``, ``time`` or ``list``: what a field of that node holds; None for other messages."""
    from rosbags.interfaces import Nodetype

    if node == Nodetype.NAME:
        return "time" if of in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration") else None
    if node == Nodetype.BASE:
        return "text" if "string" in of[0] else "number"
    if node is not None and of[0][0] == Nodetype.BASE and "string" not in of[0][1][0]:
        return "list"
    return None


def _imu(bag: _Bag, path: Path) -> tuple[Channel, ...]:
    """The channels of the only topic of `sensor_msgs/Imu`."""
    topics = [name for name, topic in bag.topics.items() if topic.kind == _IMU]
    if len(topics) != 1:
        there = f"the topics {' and '.join(topics)} of {_IMU}" if topics else f"{bag.words}, none of {_IMU}"
        raise RecordError(path, f"found {there}, expected one, or a column map")
    return tuple(
        Channel(name, f"{topics[0]}/{field}", parse_unit(unit)) for name, (field, unit) in _CHANNELS.items()
    )


def _contents(
    bag: _Bag,
    places: Collection[tuple[str, str]],
    path: Path,
    progress: Callable[[float], None],
    limit: int | None = None,
) -> Contents:
    """The wanted (topic, field) as arrays with the clocks of their topics; ``progress`` is told the part done."""
    wanted: dict[str, dict[str, list[Any]]] = {}
    for topic, field in sorted(places):
        stamps = [each for each in (_STAMP, _RECORDED) if bag.topics[topic].content(each)]
        wanted.setdefault(topic, {each: [] for each in stamps}).setdefault(field, [])
    findings = _collect(bag, wanted, path, progress, limit)
    arrays = {}
    for topic, columns in wanted.items():
        of = bag.topics[topic]
        values = {field: _array(of.content(field), column) for field, column in columns.items()}
        clock = _STAMP if _STAMP in values else _RECORDED
        if clock == _STAMP and not values[_STAMP].astype(np.int64).any():
            clock = _RECORDED
            text = f"all header stamps of {topic} are zero, the times of recording are used"
            findings.append(Finding("duplicate_time", text))
        for field, column in values.items():
            if column.ndim > 2 or column.dtype == object:
                raise RecordError(path, f"{topic}/{field} has lists of several lengths, expected one")
            if clock == _RECORDED and field == _STAMP and (topic, field) not in places:
                continue
            unit = _UNITS.get(field) if of.kind == _IMU else None
            own = None if field in (_STAMP, _RECORDED) else f"{topic}/{clock}"
            arrays[f"{topic}/{field}"] = held(column, unit, own)
    return Contents(arrays, tuple(findings), described=bag.words)


def _collect(
    bag: _Bag,
    wanted: Mapping[str, Mapping[str, list[Any]]],
    path: Path,
    progress: Callable[[float], None],
    limit: int | None,
) -> list[Finding]:
    """Append the fields of each message to their lists; a bag that breaks off is read up to there."""
    connections = [each for topic in wanted for each in bag.topics[topic].connections]
    if not connections:
        return []
    take = {
        topic: [(attrgetter(field), column) for field, column in columns.items() if field != _RECORDED]
        for topic, columns in wanted.items()
    }
    total, done = sum(bag.topics[topic].count for topic in wanted), 0
    try:
        for connection, recorded, raw in bag.reader.messages(connections=connections):
            message = bag.reader.deserialize(raw, connection.msgtype)
            values = [get(message) for get, _ in take[connection.topic]]
            for (_, column), value in zip(take[connection.topic], values, strict=True):
                column.append(value)
            wanted[connection.topic][_RECORDED].append(recorded)
            done += 1
            if done % _TOLD == 0:
                progress(done / total)
            if done == limit:
                return []
    except Exception as error:  # whatever the library trips over in a damaged file
        if done == 0:
            raise
        return [
            Finding("truncated", f"the bag breaks off after {counted(done, 'message')} ({reason(error)})")
        ]
    progress(1.0)
    if done < total:
        return [Finding("truncated", f"the bag holds {counted(done, 'message')} of the {total} stated")]
    return []


def _array(kind: str | None, column: list[Any]) -> NDArray[Any]:
    """The values of a field, one for each message."""
    if kind != "time":
        lengths = {len(value) for value in column} if kind == "list" else set()
        return np.array(column, dtype=object if len(lengths) > 1 else None)
    if column and not isinstance(column[0], int):
        column = [value.sec * 10**9 + value.nanosec for value in column]
    return np.array(column, dtype=np.int64).astype("datetime64[ns]")
