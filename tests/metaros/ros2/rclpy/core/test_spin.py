"""`rclpy.init`, `spin` and `shutdown` with the default context, as programs use them."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from metaros.ros2 import rclpy
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.signals import SignalHandlerOptions, get_current_signal_handlers_options
from metaros.ros2.rclpy.core.subscription import Subscription
from metaros.ros2.rclpy.execution.executor_errors import ExternalShutdownException
from metaros.ros2.rosidl.catalogue import interface
from tests.support.waiting import wait_until

STRING = "std_msgs/msg/String"


@pytest.fixture(autouse=True)
def _router(ros2_router: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("METAROS_ZENOH_PORT", ros2_router)
    monkeypatch.setattr("sys.argv", ["program"])
    python = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    rclpy.try_shutdown()
    rclpy.uninstall_signal_handlers()
    signal.signal(signal.SIGINT, python)


def test_init_and_shutdown() -> None:
    assert not rclpy.ok()
    for _ in range(2):
        rclpy.init()
        assert rclpy.ok()
        assert get_current_signal_handlers_options() is SignalHandlerOptions.ALL
        with pytest.raises(RuntimeError, match="only be called once"):
            rclpy.init()
        rclpy.shutdown()
        assert not rclpy.ok()
        assert get_current_signal_handlers_options() is SignalHandlerOptions.NO
    with pytest.raises(RuntimeError):
        rclpy.shutdown()
    with rclpy.init(domain_id=123) as manager:
        assert manager.context is rclpy.get_default_context()
        assert manager.context.get_domain_id() == 123
    assert not manager.context.ok()
    assert get_current_signal_handlers_options() is SignalHandlerOptions.NO
    own = Context()
    with rclpy.init(context=own):
        assert own.ok()
        assert not rclpy.ok()
        assert get_current_signal_handlers_options() is SignalHandlerOptions.NO
    assert not own.ok()


def test_init_after_a_context_was_shut_down_from_within() -> None:
    rclpy.init()
    rclpy.get_default_context().shutdown()
    rclpy.init()
    assert rclpy.ok()


def test_spin_until_a_callback_shuts_down() -> None:
    rclpy.init()
    node = rclpy.create_node("talker")
    heard: list[str] = []
    publisher = node.create_publisher(interface(STRING), "chatter", 10)

    def listen(message: Any) -> None:
        heard.append(message.data)
        if len(heard) == 3:
            rclpy.shutdown()

    node.create_subscription(interface(STRING), "chatter", listen, 10)
    node.create_timer(0.001, lambda: publisher.publish(interface(STRING)(data=str(len(heard)))))
    rclpy.spin(node)
    assert len(heard) == 3
    assert not rclpy.ok()
    node.destroy_node()


def test_spin_once_runs_one_callback_or_waits() -> None:
    rclpy.init()
    node = rclpy.create_node("one")
    rclpy.spin_once(node, timeout_sec=0)
    called = []
    for number in range(3):
        node.create_guard_condition(lambda number=number: called.append(number)).trigger()  # type: ignore[misc]
    rclpy.spin_once(node, timeout_sec=30)
    assert len(called) == 1
    assert rclpy.get_global_executor() is rclpy.get_global_executor()
    first = rclpy.get_global_executor()
    rclpy.shutdown()
    rclpy.init()
    assert rclpy.get_global_executor() is not first


def test_what_a_callback_raises_comes_out_of_spin_and_its_callback_can_be_replaced() -> None:
    rclpy.init()
    node = rclpy.create_node("listener")

    def fail(message: Any) -> None:
        raise ZeroDivisionError(message.data)

    subscription = node.create_subscription(interface(STRING), "chatter", fail, 10)
    publisher = node.create_publisher(interface(STRING), "chatter", 10)
    publisher.publish(interface(STRING)(data="first"))
    with pytest.raises(ZeroDivisionError, match="first"):
        rclpy.spin(node)
    infos: list[Any] = []
    future: Any = rclpy.Future()

    def with_info(message: Any, info: Any) -> None:
        infos.append((message.data, info["publication_sequence_number"]))
        future.set_result(None)

    subscription.callback = with_info
    assert subscription.callback is with_info
    assert subscription._callback_type is Subscription.CallbackType.WithMessageInfo
    publisher.publish(interface(STRING)(data="second"))
    rclpy.spin_until_future_complete(node, future, timeout_sec=30)
    assert infos == [("second", 2)]
    with pytest.raises(RuntimeError, match="one argument"):
        subscription.callback = lambda a, b, c: None


def test_signals_end_spin() -> None:
    cases: list[tuple[signal.Signals, type[BaseException]]] = [
        (signal.SIGTERM, ExternalShutdownException),
        (signal.SIGINT, KeyboardInterrupt),
    ]
    for number, error in cases:
        rclpy.init()
        node = rclpy.create_node("ended")
        spinning = threading.Event()
        node.create_guard_condition(spinning.set).trigger()

        def kill(number: signal.Signals = number, spinning: threading.Event = spinning) -> None:
            wait_until(spinning.is_set)
            os.kill(os.getpid(), number)

        thread = threading.Thread(target=kill)
        thread.start()
        with pytest.raises(error):
            rclpy.spin(node)
        thread.join()
        assert not rclpy.ok()
        node.destroy_node()
        rclpy.shutdown()


def test_modules_are_attributes_as_in_rclpy() -> None:
    assert rclpy.executors.SingleThreadedExecutor
    assert rclpy.context.Context is rclpy.Context
    assert rclpy.Node is rclpy.node.Node
    assert rclpy.Parameter is rclpy.parameter.Parameter
    with pytest.raises(AttributeError, match="no attribute 'what'"):
        rclpy.what  # noqa: B018
