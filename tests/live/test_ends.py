"""Live sources with real ends: what is sent by wire is measured as the same lines are from a file, or is counted."""

import io

import pytest
from wires import HEADER, STUDY, Cable, Datagrams, Mosquitto, Server, free_port, rows, until

from inercal.live.measurement import measure
from inercal.stream.lines import Lines
from inercal.stream.monitor import Monitor
from inercal.stream.run import run


def by_stream(lines):
    """The output of ``monitor`` on lines from a file."""
    out = []
    stream = Lines(io.BytesIO(b"".join(lines)), "lines", None, lambda finding: None)
    run(Monitor(stream), stream, out.append)
    return [f"{line}\n" for line in out]


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "imu.toml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="module")
def broker(tmp_path_factory):
    made = Mosquitto(tmp_path_factory.mktemp("broker"))
    yield made
    made.kill()


class Topic:
    """A sender of messages."""

    def __init__(self, broker, topic):
        self.client, self.topic = broker.client(), topic
        assert until(self.client.is_connected)

    def send(self, data):
        self.client.publish(self.topic, data, qos=1).wait_for_publish(10.0)

    def close(self):
        self.client.disconnect()
        self.client.loop_stop()


def sender(kind, tmp_path, broker):
    """The near end of a wire, and the address of the far one."""
    match kind:
        case "serial":
            made = Cable(tmp_path)
            return made, f"serial:{made.name}?baud=921600"
        case "udp":
            port = free_port()
            return Datagrams(port), f"udp://127.0.0.1:{port}"
        case "tcp":
            made = Server()
            return made, f"tcp://127.0.0.1:{made.port}"
        case "mqtts":
            ca = broker.folder / "cert.pem"
            return Topic(broker, "rig/a"), f"mqtts://127.0.0.1:{broker.tls_port}/rig/a?ca={ca}"


@pytest.mark.parametrize("kind", ["serial", "udp", "tcp", "mqtts"])
def test_rows_by_wire_have_the_digits_of_a_stream(kind, study, tmp_path, request, monkeypatch):
    broker = request.getfixturevalue("broker") if kind == "mqtts" else None
    monkeypatch.setenv("INERCAL_MQTT_USER", Mosquitto.USER)
    monkeypatch.setenv("INERCAL_MQTT_PASSWORD", Mosquitto.PASSWORD)
    near, address = sender(kind, tmp_path, broker)
    request.addfinalizer(near.close)
    out, raw = tmp_path / "out.csv", tmp_path / "raw.csv"
    running = measure(address, study, record=raw, to=[f"text:{out}"])
    assert until(lambda: running.state in ("waiting", "ended"), 120.0)
    assert not running.failure
    sent = [HEADER, *rows(300)]
    for line in sent:
        near.send(line)
    assert until(lambda: running.counts.rows == 300), running.counts
    running.stop(wait=10.0)
    assert (running.state, running.failure) == ("ended", "")
    assert raw.read_bytes() == b"".join(sent)
    assert out.read_text().splitlines(keepends=True) == by_stream(sent)
    counts = running.counts
    assert (counts.received, counts.used) == (len(raw.read_bytes()),) * 2
    assert (counts.lost, counts.disordered, counts.repeated, counts.left_out, counts.dropped) == (0,) * 5
    assert counts.sinks[f"text:{out}"].written == 300
    assert running.latest["t"].value == 0.299
    assert running.channels["acc_z"].unit == "m/s^2"
