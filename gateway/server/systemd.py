"""sd_notify: systemd learns that the gateway is ready, that it is stopping, and that its event loop runs (watchdog).

It asks by two variables: `NOTIFY_SOCKET` names a datagram socket (`Type=notify`), `WATCHDOG_USEC` how long it waits for
the next sign of life (`WatchdogSec=`) before it ends the program and starts it again.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import sys
from collections.abc import Mapping

__all__ = ["BEAT", "ENDING", "READY", "notify_systemd", "watchdog_loop"]

READY, ENDING, BEAT = "READY=1", "STOPPING=1", "WATCHDOG=1"


def notify_systemd(word: str, environ: Mapping[str, str] = os.environ) -> bool:
    """Send one state; False where systemd did not ask for it, or the socket is gone. Never waits."""
    address = environ.get("NOTIFY_SOCKET", "")
    if sys.platform == "win32" or not address.startswith(("/", "@")):
        return False
    else:
        path = "\0" + address[1:] if address[0] == "@" else address  # @: a name without a file
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
            out.setblocking(False)
            out.sendto(word.encode(), path)
            return True
        return False


async def watchdog_loop(environ: Mapping[str, str] = os.environ) -> None:
    """Send WATCHDOG=1 three times in each WATCHDOG_USEC; returns at once where systemd did not ask for it."""
    waits_us = environ.get("WATCHDOG_USEC", "")
    meant_for = environ.get("WATCHDOG_PID", str(os.getpid()))
    if not (waits_us.isascii() and waits_us.isdigit() and int(waits_us) > 0) or meant_for != str(os.getpid()):
        return
    while True:
        notify_systemd(BEAT, environ)
        await asyncio.sleep(int(waits_us) / 3e6)
