"""Real ends for live sources: a pty pair, datagrams, a server, a broker with TLS and password; and rows to send."""

import contextlib
import datetime
import io
import ipaddress
import os
import pty
import shutil
import signal
import socket
import subprocess
import termios
import threading
import time
import tty

import numpy as np
import pytest

from inercal.bench.live.measurement import measure
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.monitor import Monitor
from inercal.faces.stream.run import run

HEADER = b"t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]\n"

STUDY = '[site]\ngravity = "9.81 m/s^2"\n[imu]\nmethod = "multiposition"\n'
"""A study of an IMU, which a live source takes for the monitor of rest and noise."""


def rows(n, rate=1000.0, seed=1, first=0):
    """Lines of an accelerometer triad at rest."""
    noise = np.random.default_rng(seed).normal(0.0, 0.01, (n, 3)).round(6)
    noise[:, 2] += 9.81
    return [
        b"%.6f,%.6f,%.6f,%.6f\n" % ((first + i) / rate, *values) for i, values in enumerate(noise.tolist())
    ]


def until(condition, seconds=20.0):
    """Wait for a condition; true once it holds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return bool(condition())


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


class Cable:
    """A pty pair under one name, as a port whose adapter can be pulled out and put in again."""

    def __init__(self, folder):
        self.name = folder / "port"
        self.master = self.slave = -1
        self.plug()

    def plug(self):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave, termios.TCSANOW)
        with contextlib.suppress(FileNotFoundError):
            self.name.unlink()
        self.name.symlink_to(os.ttyname(self.slave))

    def unplug(self):
        for end in (self.master, self.slave):
            with contextlib.suppress(OSError):
                os.close(end)

    close = unplug

    def send(self, data):
        while data:
            data = data[os.write(self.master, data) :]


class Datagrams:
    """A sender of datagrams."""

    def __init__(self, port):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.port = port

    def send(self, data):
        self.socket.sendto(data, ("127.0.0.1", self.port))

    def close(self):
        self.socket.close()


class Server:
    """A server that sends to whoever has connected last."""

    def __init__(self, port=0, greeting=b""):
        self.greeting = greeting
        self.port = port
        self.open()

    def open(self):
        self.listening = socket.socket()
        self.listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.listening.bind(("127.0.0.1", self.port))
        self.port = self.listening.getsockname()[1]
        self.listening.listen()
        self.client = None
        threading.Thread(target=self._accept, args=(self.listening,), daemon=True).start()

    def _accept(self, listening):
        with contextlib.suppress(OSError):
            while True:
                client, _ = listening.accept()
                client.sendall(self.greeting)
                self.client = client

    def send(self, data):
        assert until(lambda: self.client is not None)
        self.client.sendall(data)

    def close(self):
        with contextlib.suppress(OSError):
            self.listening.shutdown(socket.SHUT_RDWR)  # wakes who accepts
        self.listening.close()
        if self.client is not None:
            with contextlib.suppress(OSError):
                self.client.shutdown(socket.SHUT_RDWR)
            self.client.close()
            self.client = None


def certificate(folder):
    """A key and a certificate that signs itself, for the loopback address."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, "a broker of the tests")])
    now = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), critical=False
        )
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )
    pem = serialization.Encoding.PEM
    (folder / "cert.pem").write_bytes(made.public_bytes(pem))
    (folder / "key.pem").write_bytes(
        key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )


MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


class Mosquitto:
    """Debian's broker as a child process, on free ports of this machine: with TLS at one, without at the other."""

    USER, PASSWORD = "rig", "open sesame"

    def __init__(self, folder):
        if MOSQUITTO is None:
            pytest.skip("mosquitto, the broker of these tests, is not installed")
        self.folder = folder
        certificate(folder)
        self.port, self.tls_port = free_port(), free_port()
        passwords = folder / "passwords"
        passwords.write_text(f"{self.USER}:{self.PASSWORD}\n")
        passwords.chmod(0o600)
        subprocess.run([shutil.which("mosquitto_passwd"), "-U", passwords], check=True, capture_output=True)
        lines = [
            "per_listener_settings false", "allow_anonymous false", f"password_file {passwords}",
            "max_queued_messages 100000", f"listener {self.port} 127.0.0.1", f"listener {self.tls_port} 127.0.0.1",
            f"certfile {folder / 'cert.pem'}", f"keyfile {folder / 'key.pem'}",
        ]  # fmt: skip
        if os.getuid() == 0:
            lines.insert(0, "user root")
        (folder / "broker.conf").write_text("\n".join(lines) + "\n")
        self.process = None
        self.start()

    def start(self):
        with open(self.folder / "broker.log", "ab") as log:
            self.process = subprocess.Popen(
                [MOSQUITTO, "-c", self.folder / "broker.conf"], stdout=log, stderr=log
            )

        def listening():
            assert self.process.poll() is None, (self.folder / "broker.log").read_text()
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.tls_port), 1.0):
                return True

        assert until(listening)

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def client(self, topic="", receive=None):
        """A client of the library itself, which sends to a topic, or gives what comes on it to a function."""
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        made = Client(CallbackAPIVersion.VERSION2)
        made.username_pw_set(self.USER, self.PASSWORD)
        made.max_inflight_messages_set(1000)
        subscribed = threading.Event()
        made.on_subscribe = lambda *_: subscribed.set()
        made.connect("127.0.0.1", self.port)
        made.loop_start()
        if receive is not None:
            made.on_message = lambda *given: receive(given[2].payload)
            assert until(made.is_connected)
            made.subscribe(topic, qos=1)
            assert subscribed.wait(10.0)
        return made


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


def wire(kind, folder, broker=None):
    """The near end of a wire, and the address of the far one."""
    match kind:
        case "serial":
            made = Cable(folder)
            return made, f"serial:{made.name}?baud=921600"
        case "udp":
            port = free_port(socket.SOCK_DGRAM)
            return Datagrams(port), f"udp://127.0.0.1:{port}"
        case "tcp":
            made = Server()
            return made, f"tcp://127.0.0.1:{made.port}"
        case "mqtts":
            ca = broker.folder / "cert.pem"
            return Topic(broker, "rig/a"), f"mqtts://127.0.0.1:{broker.tls_port}/rig/a?ca={ca}"


def by_stream(lines, record_map=None):
    """The output of ``monitor`` on lines from a file."""
    out = []
    stream = Lines(io.BytesIO(b"".join(lines)), "lines", record_map, lambda finding: None)
    run(Monitor(stream), stream, out.append)
    return [f"{line}\n" for line in out]


def waiting(address, study, **given):
    """A measurement that is ready for rows."""
    running = measure(address, study, **given)
    assert until(lambda: running.state in ("waiting", "ended"), 120.0)
    assert not running.failure
    return running
