"""`rclpy.signals`: SIGINT and SIGTERM shut the contexts down.

Who spins then gets what rclpy gives: KeyboardInterrupt after SIGINT, since Python's own handler still has its say, and
ExternalShutdownException after SIGTERM.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from enum import Enum
from types import FrameType
from typing import Any

from metaros.ros2.rclpy.core.context import living_contexts

__all__ = [
    "SignalHandlerOptions",
    "get_current_signal_handlers_options",
    "install_signal_handlers",
    "uninstall_signal_handlers",
]

Handler = Callable[[int, FrameType | None], Any]


class SignalHandlerOptions(Enum):
    """Which signals shut contexts down."""

    NO = 0
    SIGINT = 1
    SIGTERM = 2
    ALL = 3


class _Installed:
    """What was there before, by signal."""

    def __init__(self) -> None:
        self.lock = threading.RLock()  # a program's own handler may shut down, and uninstall, in the middle of anything
        self.before: dict[signal.Signals, Any] = {}
        self.options = SignalHandlerOptions.NO


_installed = _Installed()


def install_signal_handlers(options: SignalHandlerOptions = SignalHandlerOptions.ALL) -> None:
    """Let these signals shut down every context. Off the main thread, where Python allows no handlers, only noted."""
    with _installed.lock:
        if options is SignalHandlerOptions.NO:
            return
        _installed.options = SignalHandlerOptions(_installed.options.value | options.value)
        if threading.current_thread() is not threading.main_thread():
            return
        if options in (SignalHandlerOptions.ALL, SignalHandlerOptions.SIGINT):
            _install(signal.SIGINT)
        if options in (SignalHandlerOptions.ALL, SignalHandlerOptions.SIGTERM):
            _install(signal.SIGTERM)


def _install(number: signal.Signals) -> None:
    if signal.getsignal(number) is not _handle:
        _installed.before[number] = signal.signal(number, _handle)


def _handle(number: int, frame: FrameType | None) -> None:
    """Contexts first, so that whoever is woken finds them shut; then whose turn it was before us."""
    for context in living_contexts():
        context._end_by_signal()
    before = _installed.before.get(signal.Signals(number))
    if callable(before):
        before(number, frame)


def get_current_signal_handlers_options() -> SignalHandlerOptions:
    """Which handlers are installed."""
    return _installed.options


def uninstall_signal_handlers() -> None:
    """Give the signals back to whom they were before, unless another has taken them meanwhile."""
    with _installed.lock:
        _installed.options = SignalHandlerOptions.NO
        if threading.current_thread() is not threading.main_thread():
            return
        for number, before in _installed.before.items():
            if signal.getsignal(number) is _handle:
                signal.signal(number, before)
        _installed.before.clear()
