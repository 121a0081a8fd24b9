"""What systemd is told of a gateway that it started: that it is ready, that it ends, and that its event loop turns.

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

__all__ = ["BEAT", "ENDING", "READY", "beat", "tell_systemd"]

READY, ENDING, BEAT = "READY=1", "STOPPING=1", "WATCHDOG=1"


def tell_systemd(word: str, environ: Mapping[str, str] = os.environ) -> bool:
    """Say one of the words; False where nobody asked, or nobody hears it. Never waits."""
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


async def beat(environ: Mapping[str, str] = os.environ) -> None:
    """Three times in each of systemd's waits say that this event loop turns; ends at once where nobody waits."""
    waits_us = environ.get("WATCHDOG_USEC", "")
    meant_for = environ.get("WATCHDOG_PID", str(os.getpid()))
    if not (waits_us.isascii() and waits_us.isdigit() and int(waits_us) > 0) or meant_for != str(os.getpid()):
        return
    while True:
        tell_systemd(BEAT, environ)
        await asyncio.sleep(int(waits_us) / 3e6)
