"""Live sources with real ends: what is sent by wire is measured as the same lines are from a file, or is counted."""

import pytest
from wires import HEADER, Cable, Server, by_stream, free_port, rows, until, waiting, wire

from inercal.bench.live import sources
from inercal.bench.live.address import source_of
from inercal.bench.live.measurement import measure
from inercal.bench.live.sources import Intake

KINDS = ("serial", "udp", "tcp", "mqtts")


def sound(running):
    """Ended in order, every byte in its place."""
    running.stop(wait=20.0)
    assert (running.state, running.failure) == ("ended", "")
    counts = running.counts
    assert counts.waiting == 0
    assert counts.received == counts.used + counts.left_out
    return counts


@pytest.mark.parametrize("kind", KINDS)
def test_rows_by_wire_have_the_digits_of_a_stream(kind, study, tmp_path, request):
    near, address = wire(kind, tmp_path, request.getfixturevalue("broker") if kind == "mqtts" else None)
    request.addfinalizer(near.close)
    out, raw = tmp_path / "out.csv", tmp_path / "raw.csv"
    running = waiting(address, study, record=raw, to=[f"text:{out}"])
    sent = [HEADER, *rows(300)]
    for line in sent:
        near.send(line)
    assert until(lambda: running.counts.rows == 300), running.counts
    counts = sound(running)
    assert raw.read_bytes() == b"".join(sent)
    assert out.read_text().splitlines(keepends=True) == by_stream(sent)
    assert counts.used == len(b"".join(sent))
    assert (counts.lost, counts.disordered, counts.repeated, counts.left_out, counts.dropped) == (0,) * 5
    assert counts.sinks[f"text:{out}"].written == 300
    assert running.latest["t"].value == 0.299
    assert running.channels["acc_z"].unit == "m/s^2"
    at, some = running.rows()
    assert 1 <= len(some) <= at
    assert len(some[0]) == len(running.columns)


def pull_out(kind, near, broker):
    match kind:
        case "serial":
            near.unplug()
        case "tcp":
            near.close()
        case "mqtts":
            broker.kill()


def put_in(kind, near, broker):
    match kind:
        case "serial":
            near.plug()
        case "tcp":
            near.open()
        case "mqtts":
            broker.start()
            assert until(near.client.is_connected)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["serial", "tcp", "mqtts"])
def test_unplugged_and_plugged_in_again(kind, study, tmp_path, request, quick):
    """The row that the break cut, and the one that the second beginning cuts, are in no digit, but are counted."""
    broker = request.getfixturevalue("broker") if kind == "mqtts" else None
    near, address = wire(kind, tmp_path, broker)
    request.addfinalizer(near.close)
    out, raw = tmp_path / "out.csv", tmp_path / "raw.csv"
    running = waiting(address, study, record=raw, to=[f"text:{out}"])
    first, second = rows(200), rows(200, seed=2, first=250)
    whole_rows = kind == "mqtts"
    begun = b"" if whole_rows else first[-1][:13]
    near.send(HEADER + b"".join(first[:-1]) + begun)
    assert until(lambda: running.counts.received == len(HEADER + b"".join(first[:-1]) + begun))
    assert running.alive
    pull_out(kind, near, broker)
    assert until(lambda: not running.alive)
    assert until(lambda: sum("cannot be opened" in alarm.message for alarm in running.alarms) > 1)
    put_in(kind, near, broker)
    assert until(lambda: running.alive)
    near.send((b"" if whole_rows else second[0][9:]) + b"".join(second[1:]))
    assert until(lambda: running.counts.rows == 398), running.counts
    counts = sound(running)
    sent = [HEADER, *first[:-1], *second[1:]]
    assert raw.read_bytes() == b"".join(sent)
    assert out.read_text().splitlines(keepends=True) == by_stream(sent)
    assert counts.reconnections == 1
    assert counts.cut == (0 if whole_rows else 2)
    assert counts.left_out == (0 if whole_rows else len(begun) + len(second[0][9:]))
    assert counts.lost == 52
    told = [alarm.message for alarm in running.alarms]
    assert any(": lost (" in text and "tried again in 0.05 s" in text for text in told)
    assert any("tried again in 0.2 s" in text for text in told)  # the pauses grow to their limit
    assert any("there again" in text for text in told)


def test_a_device_that_begins_anew_says_its_header_again(study, tmp_path, quick, request):
    near = Server(greeting=HEADER)
    request.addfinalizer(near.close)
    out = tmp_path / "out.csv"
    running = waiting(f"tcp://127.0.0.1:{near.port}", study, to=[f"text:{out}"])
    first, second = rows(100), rows(100, seed=3, first=100)
    near.send(b"".join(first))
    assert until(lambda: running.counts.rows == 100)
    near.close()
    assert until(lambda: not running.alive)
    near.open()
    near.send(b"".join(second))
    assert until(lambda: running.counts.rows == 200), running.counts
    assert sound(running).left_out == 0
    assert out.read_text().splitlines(keepends=True) == by_stream([HEADER, *first, *second])


def test_other_columns_after_a_break_end_it(study, tmp_path, quick, request):
    near = Server(greeting=HEADER)
    request.addfinalizer(near.close)
    running = waiting(f"tcp://127.0.0.1:{near.port}", study)
    near.send(b"".join(rows(10)))
    assert until(lambda: running.counts.rows == 10)
    near.close()
    assert until(lambda: not running.alive)
    near.greeting = HEADER.replace(b"acc_x", b"acc_w")
    near.open()
    near.send(b"".join(rows(10, first=10)))
    assert running.join(20.0)
    assert "found other columns than at its beginning" in running.failure


def test_lost_disordered_and_repeated_datagrams_are_counted(study, tmp_path, request):
    near, address = wire("udp", tmp_path)
    request.addfinalizer(near.close)
    out = tmp_path / "out.csv"
    running = waiting(address, study, to=[f"text:{out}"])
    sent = rows(400)
    del sent[200:210]
    sent[300], sent[301] = sent[301], sent[300]
    sent.insert(350, sent[349])
    for line in (HEADER, *sent):
        near.send(line.rstrip(b"\n"))  # a datagram is whole without it
    assert until(lambda: running.counts.rows == 391), running.counts
    counts = sound(running)
    assert (counts.lost, counts.disordered, counts.repeated, counts.late) == (10, 1, 1, 0)
    assert out.read_text().splitlines(keepends=True) == by_stream([HEADER, *sent])
    codes = [alarm.code for alarm in running.alarms]
    assert codes.count("backward_time") == codes.count("duplicate_time") == 1


@pytest.mark.parametrize("kind", KINDS)
def test_one_wrong_digit_in_a_stamp_ends_nothing(kind, study, tmp_path, request):
    near, address = wire(kind, tmp_path, request.getfixturevalue("broker") if kind == "mqtts" else None)
    request.addfinalizer(near.close)
    out = tmp_path / "out.csv"
    running = waiting(address, study, to=[f"text:{out}"])
    sent = rows(400)
    sent[200] = b"9" + sent[200]
    for line in (HEADER, *sent):
        near.send(line)
    assert until(lambda: running.counts.rows == 400), running.counts
    counts = sound(running)
    assert (counts.lost, counts.disordered, counts.repeated, counts.outlying) == (0, 0, 0, 1)
    assert out.read_text().splitlines(keepends=True) == by_stream([HEADER, *sent])
    alarms = [alarm for alarm in running.alarms if alarm.code.endswith("_time")]
    assert [alarm.code for alarm in alarms] == ["outlying_time"]
    assert "90.2 s beside 0.199 and 0.201 s" in alarms[0].message


def test_a_source_that_cannot_be_opened_is_refused_in_a_sentence(study, tmp_path, broker):
    port = free_port()
    addresses = {
        f"serial:{tmp_path / 'none'}": "cannot be opened",
        f"tcp://127.0.0.1:{port}": "cannot be opened (Connection refused)",
        f"mqtt://127.0.0.1:{port}/rig": "cannot be opened (Connection refused)",
        f"mqtts://127.0.0.1:{broker.tls_port}/rig": "cannot be opened (TLS fails: CERTIFICATE_VERIFY_FAILED)",
        f"mqtts://127.0.0.1:{broker.port}/rig?ca={broker.folder / 'cert.pem'}": "cannot be opened (",
        f"mqtt://127.0.0.1:{broker.port}/rig?login={study}": "the broker refuses: ",
        f"mqtt://127.0.0.1:{broker.port}/rig?login={tmp_path / 'none'}": "expected user and password",
        f"replay:{tmp_path / 'none'}": "cannot be read (No such file or directory)",
        f"replay:{tmp_path}": "cannot be read (Is a directory)",
    }
    for address, said in addresses.items():
        running = measure(address, study)
        assert running.join(60.0)
        assert said in running.failure
        assert "\n" not in running.failure
        assert running.state == "ended"


def test_versions_of_mqtt(study, tmp_path, broker):
    """3.1.1 and 5, by a login in a file; rows as several lines in a message."""
    login = tmp_path / "login"
    login.write_text(f"{broker.USER}\n{broker.PASSWORD}\n")
    for version in ("3.1.1", "5"):
        near = broker.client()
        assert until(near.is_connected)
        address = f"mqtt://127.0.0.1:{broker.port}/rig/v?version={version}&login={login}"
        running = waiting(address, study)
        near.publish("rig/v", HEADER + b"".join(rows(50)), qos=1)
        assert until(lambda running=running: running.counts.rows == 50)
        sound(running)
        near.disconnect()
        near.loop_stop()


def test_silence_is_said(study, tmp_path, monkeypatch, request):
    monkeypatch.setattr(sources, "SILENCE", 0.1)
    near = Cable(tmp_path)
    request.addfinalizer(near.close)
    running = waiting(f"serial:{near.name}", study)
    assert until(lambda: any("nothing has come for 0.1 s" in alarm.message for alarm in running.alarms))
    assert running.alive
    sound(running)


def test_where_there_is_no_room_datagrams_are_dropped_and_counted(monkeypatch, tmp_path, request):
    monkeypatch.setattr(sources, "ROOM", 500)
    said = []
    near, address = wire("udp", tmp_path)
    request.addfinalizer(near.close)
    intake = Intake(source_of(address), said.append)
    intake.begin()
    for _ in range(20):
        near.send(b"x" * 99 + b"\n")
    assert until(lambda: intake.received == 2000)
    assert intake.dropped == 1500
    assert said == [f"{address}: rows come faster than they are worked on, some are dropped"]
    assert [intake.next(1.0).joined for _ in range(5)] == [True, False, False, False, False]
    near.send(b"y\n")
    after = intake.next(10.0)
    assert (after.piece.data, after.joined) == (b"y\n", True)  # a begun row must not go on with it
    intake.end()
    assert intake.next(0.1) is None
    assert intake.ended


def test_a_connection_waits_where_there_is_no_room(monkeypatch, tmp_path, request):
    monkeypatch.setattr(sources, "ROOM", 70_000)
    near, address = wire("tcp", tmp_path)
    request.addfinalizer(near.close)
    intake = Intake(source_of(address), pytest.fail)
    intake.begin()
    near.send(b"z" * 300_000)
    assert until(lambda: intake.received >= 65_536)
    got = b""
    while len(got) < 300_000:
        got += intake.next(10.0).piece.data
    assert got == b"z" * 300_000
    assert (intake.received, intake.dropped) == (300_000, 0)
    intake.end()
