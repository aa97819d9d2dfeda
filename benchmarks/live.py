"""Live sources: the cost of a row by each wire, and at 1 kHz the time from sample in to row out beside a step alone.

    python benchmarks/live.py [--quick]

The sender is a process of its own. The cost is the processor time of a row, all threads together, of text lines of an
accelerometer triad, and of frames of the same, through the monitor: as fast as a recording is played, or a server or
pty sends, which wait where the program is behind. At 1 kHz the shipped wind-tunnel model is measured for ten seconds,
each row sent into UDP again: the p99 from the arrival of the bytes to the row handed to the system, on the wall. With
``--soak`` ten minutes of it, one wire after the other, and the memory after each.
"""

import argparse
import gzip
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measure import PROCESSOR, Row, alone, row

from inercal.bench.live.measurement import RunningMeasurement, measure
from inercal.examples import FOLDER

HEADER = b"t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]\n"
STUDY = '[site]\ngravity = "9.81 m/s^2"\n[imu]\nmethod = "multiposition"\n'
MAP = """
[file]
sync = "FA CE"
binary = ["<u2", "<u4", "<f4", "<f4", "<f4"]
fields = ["n", "us", "x", "y", "z"]
check = "crc-16/modbus"
counter = "n"
[columns.t]
from = "us"
unit = "us"
""" + "".join(f'[columns.acc_{axis}]\nfrom = "{axis}"\nunit = "m/s^2"\n' for axis in "xyz")

SEND = """
import os, pty, socket, sys, time, tty
kind, path, rate, where = sys.argv[1:5]
rate = float(rate)
if kind == "udp":
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.connect(("127.0.0.1", int(where)))
    send = made.send
elif kind == "tcp":
    door = socket.socket()
    door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    door.bind(("127.0.0.1", int(where)))
    door.listen()
    print("ready", flush=True)
    made, _ = door.accept()
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    send = made.sendall
else:
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.symlink(os.ttyname(slave), where)
    def send(data):
        while data:
            data = data[os.write(master, data):]
if kind != "tcp":
    print("ready", flush=True)
sys.stdin.readline()
with open(path, "rb") as file:
    lines = file.readlines()
if rate:
    began = time.perf_counter()
    for k, line in enumerate(lines):
        left = began + k / rate - time.perf_counter()
        if left > 0:
            time.sleep(left)
        send(line)
else:
    for k in range(0, len(lines), 100):
        send(b"".join(lines[k:k + 100]))
sys.stdin.readline()
"""


def recording(folder: Path, count: int) -> None:
    """Write lines at rest at 1 kHz, and frames of them."""
    values = np.random.default_rng(1).normal([0.0, 0.0, 9.81], 0.01, (count, 3))
    lines = [b"%.3f,%.6f,%.6f,%.6f\n" % (k / 1000, *each) for k, each in enumerate(values.tolist())]
    (folder / "rows.csv").write_bytes(HEADER + b"".join(lines))
    frames = []
    for k, each in enumerate(values.tolist()):
        body = b"\xfa\xce" + struct.pack("<HIfff", k % 65536, 1000 * k, *each)
        frames.append(body + struct.pack("<H", modbus(body)))
    (folder / "rows.bin").write_bytes(b"".join(frames))
    (folder / "imu.toml").write_text(STUDY)
    (folder / "map.toml").write_text(MAP)


def modbus(data: bytes) -> int:
    """CRC-16/MODBUS, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def ready(running: RunningMeasurement) -> RunningMeasurement:
    """The measurement, once it waits for rows."""
    while running.state in ("new", "preparing"):
        time.sleep(0.01)
    return running


def resident() -> float:
    """Memory of this process [MiB]."""
    return int(re.search(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())[1]) / 1024


def through(
    folder: Path, kind: str, path: Path, rate: float, study: Path, to: tuple[str, ...] = ()
) -> tuple[RunningMeasurement, float]:
    """Send a file of lines through a wire; the measurement, ended, and the processor time that it took [s]."""
    port = free_port(socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM)
    where = str(folder / f"port{port}") if kind == "serial" else str(port)
    address = f"serial:{where}?baud=921600" if kind == "serial" else f"{kind}://127.0.0.1:{port}"
    command = [sys.executable, "-c", SEND, kind, str(path), str(rate), where]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as sender:
        assert sender.stdin is not None
        assert sender.stdout is not None
        sender.stdout.readline()
        running = ready(measure(address, study, to=to))
        count = path.read_bytes().count(b"\n") - 1
        began = PROCESSOR()
        sender.stdin.write("go\n")
        sender.stdin.flush()
        while running.counts.rows + running.counts.lost < count and running.state != "ended":
            time.sleep(0.02)
        seconds = PROCESSOR() - began
        running.stop(wait=30.0)
        sender.stdin.write("end\n")
        sender.stdin.flush()
    if running.failure:
        raise RuntimeError(running.failure)
    return running, seconds


def played(folder: Path, name: str, study: Path, record_map: Path | None = None) -> float:
    """Processor time [s] of a recording played as fast as it goes, its kernels loaded before."""
    for _ in range(2):  # the first loads what is compiled
        began = PROCESSOR()
        running = measure(f"replay:{folder / name}?speed=0", study, map=record_map)
        running.join()
        seconds = PROCESSOR() - began
    if running.failure:
        raise RuntimeError(running.failure)
    return seconds


def model(folder: Path, seconds: float) -> Path:
    """Lines of the shipped wind-tunnel model, as if it had been sampled at 1 kHz."""
    header, *lines = gzip.decompress((FOLDER / "sting.csv.gz").read_bytes()).splitlines(keepends=True)
    path = folder / "model.csv"
    with path.open("wb") as file:
        file.write(header)
        for k in range(round(1000 * seconds)):
            file.write(b"%.3f,%b" % (k / 1000, lines[k // 4 % len(lines)].partition(b",")[2]))
    return path


def rows(quick: bool) -> list[Row]:
    count, rounds, seconds = (2000, 1, 2.0) if quick else (40_000, 3, 10.0)
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recording(folder, count)
        study, sting = folder / "imu.toml", FOLDER / "sting.toml"
        of = {
            "`replay:` lines, a row": lambda: played(folder, "rows.csv", study),
            "`replay:` frames with CRC-16, a row": lambda: played(
                folder, "rows.bin", study, folder / "map.toml"
            ),
            "`tcp:` lines, a row": lambda: through(folder, "tcp", folder / "rows.csv", 0.0, study)[1],
            "`serial:` lines (pty), a row": lambda: through(
                folder, "serial", folder / "rows.csv", 0.0, study
            )[1],
        }
        for what, work in of.items():
            found.append(row(what, f"{count} rows", ("µs", 1e6), [work() / count for _ in range(rounds)]))
        path = model(folder, seconds)
        for kind in ("serial", "udp", "tcp"):
            steps, out, lost = [], [], []
            for _ in range(rounds):
                to = (f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}",)
                counts = through(folder, kind, path, 1000.0, sting, to)[0].counts
                (sink,) = counts.sinks.values()
                steps.append(counts.step_p99)
                out.append(sink.p99)
                lost.append(float(counts.lost + sink.dropped))
            size = f"1 kHz, {seconds:g} s"
            found += [
                row(f"`{kind}:` to `udp:`, p99 from sample in to angle out", size, ("ms", 1e3), out),
                row(f"`{kind}:`, p99 of a step of the fusion alone", size, ("ms", 1e3), steps),
                row(f"`{kind}:`, rows lost or dropped", size, ("1", 1.0), lost),
            ]
    return found


def soak(seconds: float) -> None:
    """One wire after the other at 1 kHz, with the memory after a tenth of the time and at the end."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = model(folder, seconds)
        for kind in ("serial", "udp", "tcp"):
            to = (f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}",)
            running, _ = through(folder, kind, path, 1000.0, FOLDER / "sting.toml", to)
            print(f"{kind}: {running.counts}; {resident():.0f} MiB", flush=True)


if __name__ == "__main__":
    if "--soak" in sys.argv:
        parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
        parser.add_argument("--soak", type=float, nargs="?", const=600.0)
        soak(parser.parse_args().soak)
    else:
        alone(rows, __doc__)
