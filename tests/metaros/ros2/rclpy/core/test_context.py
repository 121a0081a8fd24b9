"""Contexts: from init to shutdown, without a session: none is opened before a node needs it."""

from __future__ import annotations

import sys
import threading

import pytest

import metaros.ros2.rclpy as rclpy
from metaros.ros2.rclpy.core import utilities
from metaros.ros2.rclpy.core.context import Context, living_contexts
from metaros.ros2.rclpy.core.rcl_errors import RCLInvalidROSArgsError, UnknownROSArgsError
from tests.support.nodes.threads import on_thread


def test_ok_is_between_init_and_shutdown() -> None:
    context = Context()
    assert not context.ok()
    assert context.handle is None
    context.try_shutdown()
    with pytest.raises(RuntimeError, match="must be initialized"):
        context.shutdown()
    with pytest.raises(RuntimeError, match="must be initialized"):
        context.get_domain_id()
    context.init(args=[])
    assert context.ok()
    assert context in living_contexts()
    with pytest.raises(RuntimeError, match="only be called once"):
        context.init(args=[])
    context.shutdown()
    assert not context.ok()
    assert context not in living_contexts()
    with pytest.raises(RuntimeError, match="already"):
        context.shutdown()
    context.try_shutdown()
    assert context.handle is None


def test_it_is_a_context_manager() -> None:
    context = Context()
    with context as same:
        assert same is context
        assert context.ok()
    assert not context.ok()
    with Context() as other:
        other.shutdown()


def test_the_domain_is_given_or_that_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    found = {}
    for given in (None, 0, 42):
        context = Context()
        context.init(args=[], domain_id=given)
        found[given] = context.get_domain_id()
        context.shutdown()
    assert found == {None: 7, 0: 0, 42: 42}
    for wrong in (-1, 1000):
        with pytest.raises(RuntimeError, match=str(wrong)):
            Context().init(args=[], domain_id=wrong)
    monkeypatch.setenv("ROS_DOMAIN_ID", "far")
    with pytest.raises(RuntimeError, match="ROS_DOMAIN_ID"):
        Context().init(args=[])


def test_what_cannot_be_read_of_the_command_line_leaves_it_uninitialised() -> None:
    context = Context()
    with pytest.raises(UnknownROSArgsError, match=r"\['--what'\]"):
        context.init(args=["program", "--ros-args", "--what"])
    with pytest.raises(RCLInvalidROSArgsError, match=r"Failed to parse ROS arguments:.*not-a-rule"):
        context.init(args=["program", "--ros-args", "-r", "not-a-rule"])
    with pytest.raises(UnicodeEncodeError):
        context.init(args=["program", "Ragnar\udcc3\udcb6k"])
    assert not context.ok()
    context.init(args=["program", "--mine", "--ros-args", "-r", "a:=b"])
    assert len(context.arguments.remaps) == 1
    context.shutdown()


def test_callbacks_of_the_shutdown() -> None:
    called = []

    class Owner:
        def method(self) -> None:
            called.append("method")

    owner, gone = Owner(), Owner()
    context = Context()
    context.on_shutdown(lambda: called.append("before init"))
    context.init(args=[])
    context.on_shutdown(owner.method)
    context.on_shutdown(gone.method)
    del gone
    context.on_shutdown(lambda: called.append(f"ok is {context.ok()}"))
    with pytest.raises(TypeError, match="callable"):
        context.on_shutdown(5)  # type: ignore[arg-type]
    assert called == []
    context.shutdown()
    assert called == ["before init", "method", "ok is False"]
    context.on_shutdown(lambda: called.append("late"))
    assert called[3:] == ["late"]


def test_wakers_are_called_at_the_end_however_it_comes() -> None:
    woken = []
    for end in (Context.shutdown, Context._end_by_signal):
        context = Context()
        context.init(args=[])
        context.wake_with(lambda name=end.__name__: woken.append(name))  # type: ignore[misc]
        context.wake_with(lambda: woken.append("no more"))()
        end(context)
        assert not context.ok()
        context.try_shutdown()
    assert woken == ["shutdown", "_end_by_signal", "_end_by_signal"]


def test_no_waker_is_lost_where_threads_begin_and_end_waits() -> None:
    interval = sys.getswitchinterval()
    context, woken, done = Context(), [], threading.Event()
    context.init(args=[])
    kept = [context.wake_with(lambda: None) for _ in range(50)]  # so that there is something to go through

    def come_and_go() -> None:
        while not done.is_set():
            context.wake_with(lambda: None)()

    sys.setswitchinterval(1e-6)
    try:
        thread, raised = on_thread(come_and_go)
        for number in range(500):
            context.wake_with(lambda number=number: woken.append(number))  # type: ignore[misc]
        done.set()
        thread.join(60.0)
    finally:
        sys.setswitchinterval(interval)
    context.shutdown()
    assert (len(kept), raised, woken) == (50, [], list(range(500)))


def test_callbacks_of_the_shutdown_may_wait_for_who_needs_the_context() -> None:
    context, ended = Context(), []
    context.init(args=[])

    def wait_for_another() -> None:
        thread, _ = on_thread(lambda: context.untrack_node(None))
        thread.join(10.0)
        ended.append(not thread.is_alive())

    context.on_shutdown(wait_for_another)
    context.shutdown()
    context.on_shutdown(wait_for_another)
    assert ended == [True, True]


def test_shutdown_after_a_signal_cleans_up() -> None:
    called = []
    context = Context()
    context.init(args=[])
    context.on_shutdown(lambda: called.append(True))
    context._end_by_signal()
    assert not called
    context.shutdown()
    assert called
    with pytest.raises(RuntimeError):
        context.shutdown()


def test_the_default_context_is_another_after_its_shutdown() -> None:
    first = utilities.get_default_context()
    assert utilities.get_default_context() is first
    assert not utilities.ok()
    first.init(args=[])
    assert utilities.ok()
    utilities.shutdown()
    assert not utilities.ok()
    assert utilities.get_default_context() is not first
    with pytest.raises(RuntimeError):
        utilities.shutdown()
    utilities.try_shutdown()
    other = Context()
    other.init(args=[])
    assert utilities.ok(context=other)
    utilities.shutdown(context=other)


def test_a_handler_of_signals_may_ask_for_the_default_context_at_any_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    utilities.try_shutdown()
    asked: list[bool] = []

    def interrupted() -> Context:
        if not asked:
            asked.append(True)
            utilities.try_shutdown()  # as a handler would in the middle of get_default_context()
        return Context()

    monkeypatch.setattr(utilities, "Context", interrupted)
    thread, raised = on_thread(utilities.ok)
    thread.join(10.0)
    assert (thread.is_alive(), raised) == (False, [])


def test_the_global_executor_after_the_default_context_was_shut_down_by_itself() -> None:
    """Not by `rclpy.shutdown()`, which makes way for another one."""
    context = utilities.get_default_context()
    context.init(args=[])
    context.shutdown()
    thread, raised = on_thread(rclpy.get_global_executor)
    thread.join(10.0)
    assert (thread.is_alive(), raised) == (False, [])
    utilities.try_shutdown()


def test_small_helpers() -> None:
    assert utilities.remove_ros_args(["p", "-d", "--ros-args", "-r", "a:=b", "--", "--mine"]) == ["p", "-d", "--mine"]
    with pytest.raises(RuntimeError, match="empty"):
        utilities.remove_ros_args([])
    found = [utilities.timeout_sec_to_nsec(seconds) for seconds in (None, -1, 0, 0.5e-9, 1.5)]
    assert found == [-1, -1, 0, 0, 1_500_000_000]
    assert utilities.get_rmw_implementation_identifier() in utilities.get_available_rmw_implementations()
