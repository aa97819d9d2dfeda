"""Rows at 1 kHz to several wires at once, from a process of its own: ``sender.py ROWS SECONDS`` and the wires as JSON.

It begins once a line has come on its standard input, and says at the end how far it was behind its clock.
"""

import json
import os
import socket
import sys
import time


def sending(wires):
    """A function that sends a row to each wire, and one that waits until the broker has all."""
    takers, settle = [], lambda: None
    if port := wires.get("udp"):
        datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        takers.append(lambda row: datagrams.sendto(row, ("127.0.0.1", port)))
    if master := wires.get("serial"):

        def to_pty(row):
            while row:
                row = row[os.write(master, row) :]

        takers.append(to_pty)
    if door := wires.get("tcp"):
        listening = socket.socket(fileno=door)
        client, _ = listening.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        takers.append(client.sendall)
    if broker := wires.get("mqtt"):
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        made = Client(CallbackAPIVersion.VERSION2)
        made.username_pw_set(broker["user"], broker["password"])
        made.max_inflight_messages_set(1000)
        made.connect("127.0.0.1", broker["port"])
        made.loop_start()
        sent = []
        takers.append(lambda row: sent.__setitem__(slice(0, 1), [made.publish(broker["topic"], row, qos=1)]))

        def settle():
            sent[0].wait_for_publish(60.0)

    return takers, settle


def main():
    path, wires = sys.argv[1], json.loads(sys.argv[2])
    with open(path, "rb") as file:
        header, *rows = file.readlines()
    takers, settle = sending(wires)
    print("ready", flush=True)
    sys.stdin.readline()
    for take in takers:
        take(header)
    began, behind = time.perf_counter(), 0.0
    for k, row in enumerate(rows):
        left = began + k / 1000 - time.perf_counter()
        if left > 0.0:
            time.sleep(left)
        behind = max(behind, -left)
        for take in takers:
            take(row)
    settle()
    print(behind, flush=True)
    sys.stdin.readline()


main()
