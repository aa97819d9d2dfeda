"""Sinks of live sources: several at once, whole pieces, a slow one that stops nobody, one that fails."""

import json
import os
import socket
import threading

import h5py
import numpy as np
import pytest
from pyarrow import parquet
from wires import HEADER, Datagrams, by_stream, free_port, rows, until, waiting, wire

from inercal.bench.live import sinks
from inercal.bench.live.address import sink_of, source_of
from inercal.bench.live.counts import Stamps, TimeSpread
from inercal.bench.live.measurement import MeasurementPlan, RunningMeasurement, measure
from inercal.bench.live.pieces import EstimatorRow, payload
from inercal.bench.live.sinks import Outlet
from inercal.faces.python.study import study_of
from inercal.faces.stream.estimators import of_study


def through(near, running, lines):
    for line in lines:
        near.send(line)
    count = len(lines) - 1
    assert until(lambda: running.counts.rows == count), running.counts


def test_several_sinks_take_the_same_rows(study, tmp_path, broker, quick, request):
    near, address = wire("udp", tmp_path)
    request.addfinalizer(near.close)
    got, heard = [], []
    listener = broker.client("rig/out", got.append)
    receiving = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiving.bind(("127.0.0.1", 0))
    receiving.settimeout(0.2)

    def receive():
        while not done.is_set():
            try:
                heard.append(receiving.recv(65536))
            except TimeoutError:
                continue

    done, thread = threading.Event(), threading.Thread(target=receive)
    thread.start()
    to = [
        f"text:{tmp_path / 'out.csv'}", f"parquet:{tmp_path / 'p'}", f"hdf5:{tmp_path / 'h'}",
        f"udp://127.0.0.1:{receiving.getsockname()[1]}", f"mqtt://127.0.0.1:{broker.port}/rig/out",
    ]  # fmt: skip
    running = waiting(address, study, to=to)
    sent = [HEADER, *rows(400)]
    through(near, running, sent[:200])
    assert until(lambda: (tmp_path / "p" / "00000001.parquet").exists())
    for line in sent[200:]:
        near.send(line)
    assert until(lambda: running.counts.rows == 400)
    running.stop(wait=20.0)
    assert (running.failure, running.incomplete) == ("", False)
    assert until(lambda: len(got) == 400 and len(heard) >= 401)
    done.set()
    thread.join()
    receiving.close()
    listener.disconnect()
    listener.loop_stop()

    wanted = by_stream(sent)
    assert (tmp_path / "out.csv").read_text().splitlines(keepends=True) == wanted
    titles = wanted[0].strip().split(",")
    values = np.array(
        [[float(field or "nan") for field in line.strip("\n").split(",")] for line in wanted[1:]]
    )
    pieces = sorted((tmp_path / "p").iterdir())
    assert len(pieces) > 1
    table = parquet.read_table(tmp_path / "p")
    assert table.column_names == titles
    assert table.schema.field("still [s]").metadata == {b"units": b"s"}
    assert np.array_equal(np.column_stack([table[name] for name in titles]), values, equal_nan=True)
    for k, title in enumerate(titles):
        name, _, unit = title.partition(" [")
        parts = []
        for path in sorted((tmp_path / "h").iterdir()):
            with h5py.File(path) as file:
                parts.append(file[name][()])
                assert file[name].attrs["units"] == (unit.removesuffix("]") or "1")
        assert np.array_equal(np.concatenate(parts), values[:, k], equal_nan=True)
    lines = [line.decode() for line in heard]
    assert lines[0] == wanted[0]
    assert [line for line in lines if line != wanted[0]] == wanted[1:]
    last = json.loads(got[-1])
    assert last["t"] == {"value": 0.399, "unit": "s"}
    assert last["N_acc_z"].keys() == {"value", "u", "unit"}
    assert last["N_acc_z"]["unit"] == "m/s^2/sqrt(Hz)"
    for sink in running.counts.sinks.values():
        assert (sink.written, sink.dropped) == (400, 0)


def test_values_in_messages_have_unit_and_uncertainty():
    columns = ["t [s]", "theta [deg]", "u_theta [deg]", "u_attitude_x [rad]", "status [1]", "label"]
    told = json.loads(payload(columns, [0.5, 3.25, 0.01, 1e-3, float("nan"), "höher"]))
    assert told == {
        "t": {"value": 0.5, "unit": "s"},
        "theta": {"value": 3.25, "u": 0.01, "unit": "deg"},
        "u_attitude_x": {"value": 1e-3, "unit": "rad"},
        "status": {"value": None, "unit": "1"},
        "label": {"value": "höher", "unit": "1"},
    }


def test_a_slow_sink_stops_nobody(study, tmp_path, monkeypatch, request):
    """A pipe that nobody empties: it fills, rows for it are dropped and counted, all others get them."""
    monkeypatch.setattr(sinks, "ROOM", 200)
    monkeypatch.setattr(sinks, "GOODBYE", 0.2)
    os.mkfifo(tmp_path / "pipe")
    reading = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    near, address = wire("tcp", tmp_path)
    request.addfinalizer(near.close)
    out = tmp_path / "out.csv"
    running = waiting(address, study, to=[f"text:{tmp_path / 'pipe'}", f"text:{out}"])
    sent = [HEADER, *rows(3000)]
    near.send(sent[0])
    for k in range(1, len(sent), 100):
        near.send(b"".join(sent[k : k + 100]))
        assert until(lambda k=k: running.counts.sinks[f"text:{out}"].written >= k)
    running.stop(wait=20.0)
    slow, quick = running.counts.sinks.values()
    os.close(reading)
    assert out.read_text().splitlines(keepends=True) == by_stream(sent)
    assert (quick.written, quick.dropped) == (3000, 0)
    assert 0 < slow.written < slow.dropped < 3000
    assert 3000 - 400 <= slow.written + slow.dropped <= 3000  # but for those that its thread holds
    assert [alarm.message for alarm in running.alarms if "too slow" in alarm.message]


def test_a_sink_that_fails_is_said_and_the_others_go_on(study, tmp_path, request, quick):
    near, address = wire("udp", tmp_path)
    request.addfinalizer(near.close)
    out, folder = tmp_path / "out.csv", tmp_path / "p"
    running = waiting(address, study, to=[f"parquet:{folder}", f"text:{out}"])
    folder.rmdir()
    sent = [HEADER, *rows(300)]
    through(near, running, sent[:150])
    assert until(lambda: running.incomplete)
    for line in sent[150:]:
        near.send(line)
    assert until(lambda: running.counts.rows == 300)
    running.stop(wait=20.0)
    failed, good = running.counts.sinks.values()
    assert (failed.written, failed.dropped) == (0, 300)
    assert "cannot be written" in failed.failure
    assert good.written == 300
    assert out.read_text().splitlines(keepends=True) == by_stream(sent)
    assert running.failure == ""


def test_it_ends_where_no_sink_is_left(study, tmp_path, request, quick):
    near, address = wire("udp", tmp_path)
    request.addfinalizer(near.close)
    running = waiting(address, study, to=[f"hdf5:{tmp_path / 'h'}"])
    (tmp_path / "h").rmdir()
    lines = iter([HEADER, *rows(10_000)])

    def ended():
        near.send(next(lines))
        return running.state == "ended"

    assert until(ended)
    assert "no sink is left, the measurement ends" in [alarm.message for alarm in running.alarms]


def test_a_reader_that_leaves_ends_it_in_order(study, tmp_path):
    """As of a stream: no failure, once standard output is the only sink."""
    (tmp_path / "log.csv").write_bytes(HEADER + b"".join(rows(3000)))
    printed = []

    def print_line(text):
        if printed:
            raise OSError("its reader has left")
        printed.append(text)

    of = study_of(study)
    plan = MeasurementPlan(
        source_of(f"replay:{tmp_path / 'log.csv'}?speed=1"),
        lambda say, say_finding: of_study(of, 0.0, say, say_finding),
        sinks=[sink_of("text:-")],
    )
    running = RunningMeasurement(plan, print_line=print_line)
    running.start()
    assert running.join(60.0)
    assert (running.failure, running.incomplete) == ("", False)
    assert running.counts.rows < 3000
    said = [alarm.message for alarm in running.alarms]
    assert said == [
        "text:-: takes no more rows (its reader has left)",
        "no sink is left, the measurement ends",
    ]


def test_files_that_are_there_are_left(study, tmp_path):
    there = tmp_path / "there.csv"
    there.write_text("mine")
    port = free_port(socket.SOCK_DGRAM)
    for given in ({"to": [f"text:{there}"]}, {"record": there}):
        running = measure(f"udp://127.0.0.1:{port}", study, **given)
        assert running.join(60.0)
        assert running.failure == f"{there}: is there already, expected the name of a new file"
    assert there.read_text() == "mine"


def test_pieces_go_on_from_those_that_are_there(tmp_path):
    for k in (1, 2):
        outlet = Outlet(sink_of(f"hdf5:{tmp_path / 'h'}"), print, print)
        outlet.begin(["t [s]"])
        assert sorted(path.name for path in (tmp_path / "h").iterdir()) == [
            f"{i:08d}.h5" for i in range(1, k)
        ]
        outlet.offer(EstimatorRow("1.0", [float(k)], 0.0))
        outlet.settle()
        assert (tmp_path / "h" / f"{k:08d}.h5").exists()
        outlet.close()


def test_a_broker_that_goes_is_tried_again(study, tmp_path, broker, quick, request):
    near, address = wire("udp", tmp_path)
    request.addfinalizer(near.close)
    got = []
    running = waiting(address, study, to=[f"mqtt://127.0.0.1:{broker.port}/rig/again"])
    sent = rows(300)
    near.send(HEADER)
    for line in sent[:100]:
        near.send(line)
    assert until(lambda: running.counts.sinks and running.counts.rows == 100)
    assert until(lambda: next(iter(running.counts.sinks.values())).written == 100)
    broker.kill()
    for line in sent[100:200]:
        near.send(line)
    assert until(lambda: next(iter(running.counts.sinks.values())).dropped > 0)
    broker.start()
    listener = broker.client("rig/again", got.append)
    assert until(lambda: any("there again" in alarm.message for alarm in running.alarms))
    for line in sent[200:]:
        near.send(line)
    assert until(lambda: running.counts.rows == 300)
    running.stop(wait=20.0)
    assert until(lambda: len(got) >= 100)
    listener.disconnect()
    listener.loop_stop()
    (sink,) = running.counts.sinks.values()
    assert sink.written + sink.dropped == 300
    assert sink.written >= 200
    assert running.failure == ""


def test_stamps_are_judged():
    """Ten rows are missing, one came after its successor (and is not lost then), one twice, three are late."""
    stamps = Stamps()
    t = [k / 100 for k in range(3000)]
    del t[1000:1010]
    t[1500], t[1501] = t[1501], t[1500]
    t.insert(2000, t[1999])
    late = {2500, 2501, 2502}
    for k, each in enumerate(t):
        stamps.on(each, 1e6 + each * (1.0 + 1e-4) + (0.3 if k in late else 0.01 * (k % 2)))
    assert (stamps.lost, stamps.disordered, stamps.repeated, stamps.late) == (10, 1, 1, 3)
    early = Stamps()
    for each in [*t[:10], *t[15:200]]:
        early.on(each, None)
    assert early.lost == 5  # also before the interval was known
    early.on(float("nan"), None)
    assert early.disordered == 0


def test_quantiles_are_within_a_bin_of_those_of_all_values():
    values = np.random.default_rng(1).lognormal(-8.0, 1.0, 20_000)
    spread = TimeSpread()
    assert np.isnan(spread.quantile(0.5))
    for each in values.tolist():
        spread.on(each)
    for share in (0.5, 0.99):
        wanted = np.quantile(values, share, method="inverted_cdf")
        assert wanted <= spread.quantile(share) <= wanted * 2 ** (1 / 8) * (1 + 1e-12)


def test_nobody_at_the_other_end_of_datagrams_is_no_error():
    outlet = Outlet(sink_of(f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}"), print, pytest.fail)
    outlet.begin(["t [s]"])
    for k in range(5):
        outlet.offer(EstimatorRow(f"{k}.0", [float(k)], 0.0))
        assert until(lambda k=k: outlet.counts.written == k + 1)
    outlet.close()
    assert outlet.failure == ""


def test_a_chain_of_two(study, tmp_path, request):
    """Rows that one measurement sends are the source of another, corrected samples of a calibration, say."""
    near = Datagrams(free_port(socket.SOCK_DGRAM))
    request.addfinalizer(near.close)
    second = waiting(f"udp://127.0.0.1:{near.port}", study)
    outlet = Outlet(sink_of(f"udp://127.0.0.1:{near.port}"), print, print)
    outlet.begin(HEADER.decode().strip().split(","))
    for line in rows(100):
        text = line.decode().strip()
        outlet.offer(EstimatorRow(text, [float(each) for each in text.split(",")], 0.0))
    assert until(lambda: second.counts.rows == 100)
    outlet.close()
    second.stop(wait=10.0)
    assert second.latest["t"].value == 0.099
