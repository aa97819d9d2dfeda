"""Addresses: parsed once, or refused in one sentence that shows no password."""

from pathlib import Path

import pytest

from inercal.bench.live.address import (
    Mqtt,
    PieceFolder,
    Replay,
    SerialPort,
    Tcp,
    Text,
    Udp,
    sink_of,
    source_of,
)
from inercal.foundation.errors import InputError
from rows import for_each


@for_each(
    "text, wanted",
    [
        ("serial:/dev/ttyUSB0?baud=921600", SerialPort("/dev/ttyUSB0", 921600)),
        ("serial:COM3", SerialPort("COM3", 115200)),
        ("udp://127.0.0.1:5005", Udp("127.0.0.1", 5005)),
        ("UDP://[::1]:5005", Udp("::1", 5005)),
        ("tcp://rig-2.lab:7", Tcp("rig-2.lab", 7)),
        ("mqtt://host/a/b", Mqtt("host", 1883, "a/b")),
        ("mqtts://host/a?version=3.1.1&ca=ca.pem", Mqtt("host", 8883, "a", True, "3.1.1", Path("ca.pem"))),
        ("mqtts://host:9/a%20b?login=l", Mqtt("host", 9, "a b", True, login=Path("l"))),
        ("replay:a b.csv", Replay(Path("a b.csv"), 1.0)),
        ("replay:/tmp/a.bin?speed=0", Replay(Path("/tmp/a.bin"), 0.0)),
        ("replay:a.csv?speed=2.5", Replay(Path("a.csv"), 2.5)),
    ],
)
def test_sources(text, wanted):
    assert source_of(text) == wanted


@for_each(
    "text, wanted",
    [
        ("text:out.csv", Text(Path("out.csv"))),
        ("text:-", Text(None)),
        ("parquet:folder", PieceFolder(Path("folder"), "parquet")),
        ("hdf5:folder", PieceFolder(Path("folder"), "hdf5")),
        ("udp://127.0.0.1:1", Udp("127.0.0.1", 1)),
        ("mqtt://host/a", Mqtt("host", 1883, "a")),
    ],
)
def test_sinks(text, wanted):
    assert sink_of(text) == wanted


@for_each(
    "text, said",
    [
        ("", "found no known kind of address, expected one such as serial:"),
        ("log.csv", "found no known kind of address"),
        ("http://host/a", "found no known kind of address"),
        ("udp://host", "found no host and port"),
        ("udp://host:0", "found no host and port"),
        ("udp://host:65536", "found no host and port"),
        ("udp://a..b:5", "found no host and port"),
        ("udp:host:5", "found no host and port"),
        ("udp://host:5?x=1", "found the key 'x'"),
        ("serial:?baud=9600", "found no name"),
        ("serial:/dev/ttyS0?baud=0", "found baud='0', expected a number from 1 to 1.2e+07"),
        ("serial:/dev/ttyS0?baud=fast", "found baud='fast'"),
        ("serial:/dev/ttyS0?baud=1&baud=2", "found a key twice"),
        ("replay:a.csv?speed=-1", "found speed='-1'"),
        ("replay:a.csv?speed=1e999", "found speed='1e999'"),
        ("mqtt://host", "found no topic"),
        ("mqtt://host/a/#", "found + or # in the topic"),
        ("mqtt://host/a?version=3", "found version='3', expected 5 or 3.1.1"),
        ("mqtt://host/a?ca=x", "found ca with mqtt, expected mqtts"),
        ("mqtt://rig:secret@host/a", "found a user or password in it"),
        ("udp://host:5\n", "found 'udp://host:5"),
    ],
)
def test_what_is_no_source_is_refused_in_a_sentence(text, said):
    with pytest.raises(InputError) as refused:
        source_of(text)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "secret" not in str(refused.value)


@for_each("text", ["tcp://host:5", "serial:/dev/ttyS0", "replay:a", "text:", "parquet:", "mqtt://u:p@host/a"])
def test_what_is_no_sink_is_refused(text):
    with pytest.raises(InputError):
        sink_of(text)
