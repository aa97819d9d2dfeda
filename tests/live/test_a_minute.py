"""Four wires at 1 kHz at once: every row is used or counted, the digits are those of a file, memory does not grow."""

import gc
import json
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from wires import HEADER, Cable, Mosquitto, by_stream, free_port, rows, until, waiting

from inercal.bench.live import measurement

SENDER = Path(__file__).with_name("sender.py")


def resident():
    """Memory of this process [MiB]."""
    return int(re.search(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())[1]) / 1024


def _newest(running):
    """Stamp of the last row [s]."""
    return running.latest["t"].value if running.latest else -1.0


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is told as on Linux")
@pytest.mark.parametrize(
    "seconds",
    [
        pytest.param(6, marks=pytest.mark.slow),
        *(pytest.param(each, marks=pytest.mark.campaign) for each in (20, 60, 600)),
    ],
    ids=["six seconds", "twenty seconds", "minute", "ten minutes"],
)
def test_every_row_is_used_or_counted(seconds, study, tmp_path, broker, monkeypatch, record_property):
    monkeypatch.setattr(measurement, "KEPT", 300)
    sent = rows(1000 * seconds)
    (tmp_path / "rows.csv").write_bytes(HEADER + b"".join(sent))
    cable, port, listening = Cable(tmp_path), free_port(socket.SOCK_DGRAM), socket.socket()
    listening.bind(("127.0.0.1", 0))
    listening.listen()
    wires = {
        "udp": port, "serial": cable.master, "tcp": listening.fileno(),
        "mqtt": {"port": broker.port, "topic": "rig/minute", "user": Mosquitto.USER, "password": Mosquitto.PASSWORD},
    }  # fmt: skip
    addresses = {
        "udp": f"udp://127.0.0.1:{port}",
        "serial": f"serial:{cable.name}?baud=921600",
        "tcp": f"tcp://127.0.0.1:{listening.getsockname()[1]}",
        "mqtts": f"mqtts://127.0.0.1:{broker.tls_port}/rig/minute?ca={broker.folder / 'cert.pem'}",
    }
    running = {
        name: waiting(address, study, to=[f"text:{tmp_path / name}.csv"])
        for name, address in addresses.items()
    }
    command = [sys.executable, str(SENDER), str(tmp_path / "rows.csv"), json.dumps(wires)]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        pass_fds=(cable.master, listening.fileno()),
    ) as sender:
        assert sender.stdout.readline() == "ready\n"
        sender.stdin.write("go\n")
        sender.stdin.flush()
        time.sleep(seconds / 3)
        gc.collect()
        early, blocks = resident(), sys.getallocatedblocks()
        behind = float(sender.stdout.readline())
        last = 0.001 * (len(sent) - 1)
        assert until(lambda: all(_newest(each) >= last - 1e-9 for each in running.values()), 60.0)
        gc.collect()
        late, more = resident(), sys.getallocatedblocks() - blocks
        for each in running.values():
            each.stop()
        sender.stdin.write("end\n")
        sender.stdin.flush()
    wanted = by_stream([HEADER, *sent])
    for name, each in running.items():
        assert each.join(30.0)
        counts = each.counts
        (sink,) = counts.sinks.values()
        print(f"{name}: {counts}")
        record_property(name, str(counts))
        assert each.failure == ""
        assert counts.rows + counts.lost == len(sent)
        assert counts.waiting == counts.dropped == 0
        assert counts.received == counts.used + counts.left_out
        assert sink.written + sink.dropped == counts.rows
        lines = (tmp_path / f"{name}.csv").read_text().splitlines(keepends=True)
        assert len(lines) == 1 + sink.written
        if counts.lost == sink.dropped == 0:
            assert lines == wanted
        if name != "udp":  # nothing is lost where the wire itself loses nothing
            assert counts.lost == 0
    print(f"the sender was {behind:.3f} s behind at most; memory {early:.1f} MiB, then {late:.1f} MiB")
    print(f"{more} more objects")
    if seconds >= 20:  # in less, what begins with the wires outweighs what a leak would leave
        assert more < 500 * seconds  # an object for each row of one wire would be 667
        # 150 bytes for each row of all wires, and what waits on a busy machine
        assert late - early < 12.0 + 0.2 * seconds
    cable.close()
    listening.close()
