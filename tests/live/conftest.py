"""A study and a broker for the tests of live sources."""

import pytest
from wires import STUDY, Mosquitto

from inercal.bench.live import pieces, sources


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "imu.toml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="session")
def shared_broker(tmp_path_factory):
    made = Mosquitto(tmp_path_factory.mktemp("broker"))
    yield made
    made.kill()


@pytest.fixture
def broker(shared_broker, monkeypatch):
    """The broker, its user and password in the environment."""
    monkeypatch.setenv("INERCAL_MQTT_USER", Mosquitto.USER)
    monkeypatch.setenv("INERCAL_MQTT_PASSWORD", Mosquitto.PASSWORD)
    return shared_broker


@pytest.fixture
def quick(monkeypatch):
    """Short pauses, and pieces of a fifth of a second."""
    monkeypatch.setattr(sources, "PAUSES", (0.05, 0.2))
    monkeypatch.setattr(pieces, "SPAN", 0.2)
