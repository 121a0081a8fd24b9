"""What any server pays that writes once a tick and viewer: a loop that hands ready-made bytes to the system.

    python -m load_tests.fanout.bare [--tick-ms 5] [--core 0]

No queue, no check, no event loop, nobody told apart: what it takes is the system's own price of so many writes on this
machine, which no server with as many writes can be below. To a viewer it looks like the gateway's stream.
"""

from __future__ import annotations

import argparse
import os
import socket
import sys
import threading
import time

from gateway.api.ws.writer import BINARY, TEXT, frame
from gateway.domain.records import HEADER, record_bytes
from load_tests.fanout.load import SETTLE_S, Load, due_of, read_load

__all__ = ["main"]

GREETING = (
    b"HTTP/1.1 101 Switching Protocols\r\n\r\n" + frame(TEXT, b'{"op":"welcome"}') + frame(TEXT, b'{"op":"error"}')
)


def _accept(listener: socket.socket, viewers: list[socket.socket]) -> None:
    while True:
        viewer, _ = listener.accept()
        viewer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        asked = b""
        while b"\r\n\r\n" not in asked:
            asked += viewer.recv(4096)
        viewer.sendall(GREETING)
        viewers.append(viewer)


def _records(load: Load, count: int) -> bytes:
    """So many samples as one message of the stream, all made now."""
    header = HEADER.pack(record_bytes(load.size), 1, 1, load.size, 0, 0, 0)
    payload = time.monotonic_ns().to_bytes(8, "little") + b"x" * (load.size - 8) + bytes(-load.size & 7)
    return frame(BINARY, (header + payload) * count)


def _publish(viewers: list[socket.socket], load: Load, tick_s: float) -> int:
    sent = 0
    for due in due_of(load):
        if due:
            data = _records(load, due)
            for viewer in viewers:
                viewer.send(data)
            sent += due
        time.sleep(tick_s)
    return sent


def main(argv: list[str]) -> int:
    """Be the server."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tick-ms", type=float, default=5.0, help="between two writes to the same viewer")
    parser.add_argument("--core", type=int, help="the one CPU that it runs on")
    options = parser.parse_args(argv)
    if options.core is not None:
        os.sched_setaffinity(0, {options.core})
    listener, viewers = socket.create_server(("127.0.0.1", 0), backlog=1024), list[socket.socket]()
    threading.Thread(target=_accept, args=(listener, viewers), daemon=True).start()
    print(listener.getsockname()[1], flush=True)
    served: list[socket.socket] = []  # those of the last load, who are gone by the time of the next one
    while (load := read_load()) is not None:
        served[:] = viewers
        sent = _publish(served, load, options.tick_ms / 1000)
        del viewers[: len(served)]
        time.sleep(SETTLE_S)
        print(sent, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
