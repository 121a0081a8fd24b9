"""Handlers of signals, on this thread: pytest runs tests on the main one."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.signals import (
    SignalHandlerOptions,
    get_current_signal_handlers_options,
    install_signal_handlers,
    uninstall_signal_handlers,
)


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    uninstall_signal_handlers()
    assert {number: signal.getsignal(number) for number in before} == before


def test_which_are_installed() -> None:
    options = SignalHandlerOptions
    assert get_current_signal_handlers_options() is options.NO
    plain = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    install_signal_handlers(options.NO)
    assert get_current_signal_handlers_options() is options.NO
    install_signal_handlers(options.SIGTERM)
    assert get_current_signal_handlers_options() is options.SIGTERM
    assert signal.getsignal(signal.SIGINT) == plain[0]
    install_signal_handlers(options.SIGINT)
    assert get_current_signal_handlers_options() is options.ALL
    install_signal_handlers()
    uninstall_signal_handlers()
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == plain
    assert get_current_signal_handlers_options() is options.NO


def test_sigterm_shuts_contexts_down_and_the_program_goes_on() -> None:
    context, shut = Context(), []
    context.init(args=[])
    context.wake_with(lambda: shut.append(context.ok()))
    install_signal_handlers()
    os.kill(os.getpid(), signal.SIGTERM)
    assert shut == [False]
    context.shutdown()


def test_sigint_is_a_keyboard_interrupt_as_well() -> None:
    signal_before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        context = Context()
        context.init(args=[])
        install_signal_handlers(SignalHandlerOptions.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        assert not context.ok()
        context.try_shutdown()
        uninstall_signal_handlers()
    finally:
        signal.signal(signal.SIGINT, signal_before)


def test_a_handler_that_came_later_stays() -> None:
    before = signal.getsignal(signal.SIGTERM)
    install_signal_handlers()

    def own(*_: object) -> None:
        pass

    signal.signal(signal.SIGTERM, own)
    uninstall_signal_handlers()
    assert signal.signal(signal.SIGTERM, before) is own


def test_off_the_main_thread_nothing_is_installed() -> None:
    before = signal.getsignal(signal.SIGTERM)
    thread = threading.Thread(target=install_signal_handlers)
    thread.start()
    thread.join()
    assert signal.getsignal(signal.SIGTERM) == before
    assert get_current_signal_handlers_options() is SignalHandlerOptions.ALL
