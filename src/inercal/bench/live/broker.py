"""A connection to an MQTT broker: login, TLS, and what ends it, for sources and sinks alike."""

from __future__ import annotations

import os
import ssl
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from inercal.bench.live.address import Mqtt
from inercal.foundation._files import read_bytes
from inercal.foundation.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from paho.mqtt.client import Client

USER, PASSWORD = "INERCAL_MQTT_USER", "INERCAL_MQTT_PASSWORD"
"""Variables of the environment that hold user and password, where the address names no file of them."""

PATIENCE = 5.0
"""Time [s] within which a broker must answer."""


class Broker:
    """A connected client; ``lost`` says why it no longer is, empty as long as it is.

    Raises `OSError` where the broker cannot be reached or refuses, `InputError` for a login or certificates that cannot
    be read.
    """

    def __init__(self, at: Mqtt, receive: Callable[[bytes], None] | None = None) -> None:
        self._answered = threading.Event()
        self.lost = "the broker has not answered"
        self._topic, self._receive = at.topic, receive
        self._sockets: list[Any] = []
        self._client = _client(at, self._sockets)
        self._client.on_socket_open = lambda *given: self._sockets.append(given[2])
        self._client.on_connect = self._connected
        self._client.on_disconnect = self._disconnected
        self._client.on_connect_fail = lambda *_: self._ended("the broker cannot be reached")
        self._client.on_message = self._message
        self._client.on_subscribe = self._subscribed
        try:
            self._client.connect(at.host, at.port, keepalive=15)
        except ssl.SSLError as error:
            self._let_go()
            raise OSError(f"TLS fails: {error.reason or error}") from error
        except OSError:
            self._let_go()
            raise
        except ValueError as error:
            raise OSError(str(error)) from error
        self._client.loop_start()
        if not self._answered.wait(PATIENCE) or self.lost:
            said = self.lost
            self.close()
            raise OSError(said)

    def send(self, payloads: Sequence[bytes]) -> int:
        """Publish messages; how many of them the broker has confirmed when all are, or the connection is lost."""
        if self.lost:
            return 0
        sent = [self._client.publish(self._topic, payload, qos=1) for payload in payloads]
        confirmed = 0
        for each in sent:
            while not self.lost and each.rc == 0 and not each.is_published():
                each.wait_for_publish(0.5)
            confirmed += each.rc == 0 and each.is_published()
        return confirmed

    def close(self) -> None:
        """Say goodbye."""
        self._client.disconnect()
        self._client.loop_stop()
        self._let_go()

    def _let_go(self) -> None:
        """Close the sockets that the library leaves open where a connection fails."""
        for each in self._sockets:
            each.close()

    def _connected(self, client: Client, _: Any, __: Any, reason: Any, ___: Any = None) -> None:
        """The broker's answer: go on to subscribe, where messages are to be received."""
        if reason.is_failure:
            self._ended(f"the broker refuses: {reason}")
        elif self._receive is None:
            self.lost = ""
            self._answered.set()
        else:
            client.subscribe(self._topic, qos=1)

    def _subscribed(self, _: Client, __: Any, ___: int, reasons: Any, ____: Any = None) -> None:
        """The broker's answer to that."""
        refused = [str(reason) for reason in reasons if reason.is_failure]
        if refused:
            self._ended(f"the broker refuses the topic: {refused[0]}")
        else:
            self.lost = ""
            self._answered.set()

    def _disconnected(self, _: Client, __: Any, ___: Any, reason: Any, ____: Any = None) -> None:
        """The end of the connection."""
        self._ended(f"the broker has gone: {reason}")

    def _ended(self, why: str) -> None:
        """Remember why."""
        if not self.lost or not self._answered.is_set():
            self.lost = why
        self._answered.set()

    def _message(self, _: Client, __: Any, message: Any) -> None:
        """A message of the topic."""
        if self._receive is not None:
            self._receive(message.payload)


def _client(at: Mqtt, sockets: list[Any]) -> Client:
    """A client that is not connected yet; ``sockets`` receives those with TLS."""
    try:
        from paho.mqtt import client as paho
        from paho.mqtt.enums import CallbackAPIVersion
    except ImportError as error:
        raise MissingExtraError("MQTT", "live") from error
    protocol = paho.MQTTv5 if at.version == "5" else paho.MQTTv311
    client = paho.Client(CallbackAPIVersion.VERSION2, protocol=protocol, reconnect_on_failure=False)
    client.max_inflight_messages_set(1000)
    client.connect_timeout = PATIENCE
    user, password = _login(at)
    if user is not None:
        client.username_pw_set(user, password)
    if at.tls:
        try:
            context = ssl.create_default_context(cafile=None if at.ca is None else str(at.ca))
        except (OSError, ssl.SSLError) as error:
            raise InputError(
                at.ca, f"cannot be read ({error}), expected certificates to trust (PEM)"
            ) from error
        wrap = context.wrap_socket

        def remembered(*arguments: Any, **keywords: Any) -> ssl.SSLSocket:
            sockets.append(wrap(*arguments, **keywords))
            return sockets[-1]  # type: ignore[no-any-return]

        context.wrap_socket = remembered  # type: ignore[method-assign]
        client.tls_set_context(context)
    return client


def _login(at: Mqtt) -> tuple[str | None, str | None]:
    """User and password: of the file, else of the environment."""
    if at.login is None:
        return os.environ.get(USER), os.environ.get(PASSWORD)
    try:
        lines = read_bytes(at.login).decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            at.login, f"cannot be read ({error}), expected user and password, a line each"
        ) from error
    if len(lines) < 2:
        raise InputError(at.login, f"found {len(lines)} lines, expected user and password, a line each")
    return lines[0], lines[1]
