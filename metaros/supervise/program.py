"""The supervisor as a program: one at a time in a state directory, until it is asked to end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Final

from metaros.clock import Clock, SystemClock, boot_s, system_rng
from metaros.concurrency.file_lock import take_lock
from metaros.concurrency.signals import on_stop
from metaros.errors import ConfigError
from metaros.supervise.control import Control
from metaros.supervise.control_socket import ControlSocket
from metaros.supervise.service import NodeService
from metaros.supervise.verbs import Verbs

__all__ = ["LOCK", "STOPPED", "STOP_GRACE_S", "log_to_file", "only_one", "run", "running_pid"]

LOG = logging.getLogger("metaros.supervisor")
LOCK: Final = "supervisor.lock"
STOP_GRACE_S: Final = 10.0
STOPPED: Final = "supervisor.stopped"  # was asked to end, not killed: no agent starts it again
_LOG_BYTES: Final = 1024 * 1024


async def run(
    directory: Path,
    *,
    ready: Callable[[NodeService], None] = lambda service: None,
    clock: Clock | None = None,
    lease_s: Callable[[], float] = boot_s,
    unix: bool | None = None,
) -> None:
    """Keep the directory's table running until SIGINT, SIGTERM or `shutdown`; then stop its nodes in order.

    Call it under `only_one`, on the main thread. Raises ConfigError (the table is damaged), OSError (no socket).
    """
    stop = asyncio.Event()
    service = NodeService(directory, clock=clock or SystemClock(), rng=system_rng(), lease_s=lease_s)

    def end() -> None:
        """A second request ends it at once."""
        if stop.is_set():
            service.kill()
        stop.set()

    def shut_down() -> None:
        """Somebody wants it to stay down."""
        mark.touch()
        end()

    mark = directory / STOPPED
    control = Control(ControlSocket(directory, unix=unix), Verbs(service, shut_down).handle)
    on_stop(asyncio.get_running_loop(), end)
    await control.open()
    mark.unlink(missing_ok=True)
    try:
        service.start()
        ready(service)
        await stop.wait()
    finally:
        LOG.info("stopping")
        await service.stop(grace_s=STOP_GRACE_S)
        await control.close()


@contextmanager
def only_one(directory: Path) -> Iterator[None]:
    """Hold the directory. Raises ConfigError where another supervisor does; the lock goes with the process."""
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = (directory / LOCK).open("a+")
    except OSError as error:
        raise ConfigError(f"cannot use {directory}: {error.strerror}") from None
    with file:
        if not take_lock(file.fileno()):
            raise ConfigError(f"another supervisor (process {running_pid(directory)}) runs in {directory}")
        with contextlib.suppress(OSError):
            file.truncate(0)
            file.write(str(os.getpid()))
            file.flush()
        yield


def running_pid(directory: Path) -> int | None:
    """The process of the supervisor of a directory; None where none runs, 0 where it cannot be told."""
    try:
        with (directory / LOCK).open("r+") as file:
            if take_lock(file.fileno()):
                return None
            file.seek(0)
            text = file.read(32).strip()
            return int(text) if text.isdigit() else 0
    except OSError:
        return None


def log_to_file(path: Path) -> None:
    """The supervisor's own words, bounded: for one that nobody sees."""
    handler = RotatingFileHandler(path, maxBytes=_LOG_BYTES, backupCount=1, delay=True)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    logging.getLogger("metaros").addHandler(handler)
    logging.getLogger("metaros").setLevel(logging.INFO)
