"""LifecycleNode on a real router: callbacks in all their forms, services, events, publishers and timers that rest."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import metaros
from metaros.errors import UsageError
from metaros.interfaces.lifecycle_msgs import msg, srv
from metaros.interfaces.std_msgs.msg import String
from metaros.node.lifecycle import LifecycleNode, Result
from tests.support.waiting import wait_until


class Lidar(LifecycleNode):
    """Notes its callbacks; `answers` says what they return or raise."""

    def __init__(self, **options: Any) -> None:
        super().__init__("lidar", **options)
        self.calls: list[str] = []
        self.answers: dict[str, Any] = {}

    def _note(self, name: str) -> Any:
        self.calls.append(name)
        answer = self.answers.get(name)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def on_configure(self) -> Any:
        return self._note("configure")

    def on_activate(self, previous: Any) -> Any:
        return self._note(f"activate from {previous.label}")

    def on_deactivate(self) -> Any:
        return self._note("deactivate")

    def on_cleanup(self) -> Any:
        return self._note("cleanup")

    def on_shutdown(self) -> Any:
        return self._note("shutdown")

    def on_error(self) -> Any:
        return self._note("error")


@pytest.fixture
def lidar(here):
    with Lidar(context=here) as node:
        yield node


def test_a_subclass_is_led_through_its_life(lidar):
    states = [lidar.state.label]
    for transition in ("configure", "activate", "deactivate", "activate", "deactivate", "cleanup", "configure"):
        assert lidar.trigger(transition)
        states.append(lidar.state.label)
    assert states[:4] == ["unconfigured", "inactive", "active", "inactive"]
    assert lidar.calls[:3] == ["configure", "activate from inactive", "deactivate"]
    assert lidar.trigger("shutdown")
    assert lidar.state.label == "finalized"
    with pytest.raises(UsageError, match="nothing is possible"):
        lidar.trigger("configure")


@pytest.mark.parametrize(
    ("answer", "state", "error_called"),
    [
        (True, "inactive", False),
        (None, "inactive", False),
        (False, "unconfigured", False),
        (Result.FAILURE, "unconfigured", False),
        (Result.ERROR, "unconfigured", True),
        (OSError("no such port"), "unconfigured", True),
        ("yes", "unconfigured", True),
    ],
)
def test_what_a_callback_returns(lidar, answer, state, error_called, caplog):
    lidar.answers = {"configure": answer}
    assert lidar.trigger("configure") is (state == "inactive")
    assert lidar.state.label == state
    assert ("error" in lidar.calls) is error_called
    if isinstance(answer, OSError):
        assert "on_configure of /lidar failed" in caplog.text
        assert "no such port" in caplog.text


def test_an_error_that_is_not_handled_finalizes(lidar, here):
    lidar.answers = {"configure": OSError("smoke"), "error": False}
    assert not lidar.trigger("configure")
    assert lidar.state.label == "finalized"
    with LifecycleNode("bare", context=here) as bare:
        bare.on_configure(lambda: 1 / 0)
        assert not bare.trigger("configure")
        assert bare.state.label == "finalized"  # without on_error


def test_decorators(here):
    calls: list[str] = []
    with LifecycleNode("decorated", context=here) as node:

        @node.on_configure
        def configure() -> bool:
            calls.append("configure")
            return True

        @node.on_shutdown
        def shut(previous: Any) -> None:
            calls.append(f"shutdown from {previous.label}")

        assert node.trigger("configure")
        assert node.trigger("activate")
    assert calls == ["configure", "shutdown from active"]  # closing shuts down
    assert node.state.label == "finalized"


def test_async_callbacks(here, there, spin):
    with LifecycleNode("slow", context=here) as node:

        @node.on_configure
        async def configure() -> bool:
            await asyncio.sleep(0.01)
            return True

        @node.on_activate
        async def activate() -> None:
            await asyncio.sleep(0)
            raise OSError("no")

        with pytest.raises(UsageError, match="trigger_async"):
            node.trigger("configure")
        assert node.state.label == "unconfigured"
        spin(node)
        with metaros.Node("asker", context=there) as asker:
            client = asker.create_client(srv.ChangeState, "/slow/change_state")
            assert client.wait_for_service(60)
            assert client.call(srv.ChangeState.Request(transition=msg.Transition(id=1))).success
            assert node.state.label == "inactive"
            assert not client.call(srv.ChangeState.Request(transition=msg.Transition(label="activate"))).success
        assert node.state.label == "finalized"


def test_trigger_async(here):
    with LifecycleNode("awaited", context=here) as node:

        @node.on_configure
        async def configure() -> None:
            await asyncio.sleep(0)

        async def life() -> list[bool]:
            return [await node.trigger_async("configure"), await node.trigger_async("activate")]

        assert asyncio.run(life()) == [True, True]
        assert node.state.label == "active"


def test_no_second_transition_meanwhile(here):
    refused: list[str] = []
    with LifecycleNode("nested", context=here) as node:

        @node.on_configure
        def configure() -> None:
            try:
                node.trigger("shutdown")
            except UsageError as error:
                refused.append(str(error))

        assert node.trigger("configure")
    assert refused == ["no transition 'shutdown' from configuring: nothing is possible"]


def test_services_and_events(lidar, there, spin):
    events: list[Any] = []
    with metaros.Node("asker", context=there) as asker:
        asker.create_subscription(msg.TransitionEvent, "/lidar/transition_event", events.append)
        spin(lidar)
        spin(asker)
        change = asker.create_client(srv.ChangeState, "/lidar/change_state")
        get = asker.create_client(srv.GetState, "/lidar/get_state")
        assert change.wait_for_service(60)
        assert get.wait_for_service(60)
        wait_until(lambda: len(there.graph.endpoints("/lidar/transition_event", "MP")) == 1)
        state = get.call(srv.GetState.Request()).current_state
        assert (state.id, state.label) == (1, "unconfigured")

        def ask(**transition: Any) -> bool:
            return bool(change.call(srv.ChangeState.Request(transition=msg.Transition(**transition))).success)

        assert ask(id=1)
        assert ask(label="activate")
        assert ask(id=1, label="deactivate")  # the label counts
        assert not ask(id=99)
        assert not ask(label="fly")
        lidar.answers = {"cleanup": False}
        assert not ask(id=2)
        assert get.call(srv.GetState.Request()).current_state.label == "inactive"
        for name, count in (("get_available_transitions", 3), ("get_transition_graph", 25)):
            client = asker.create_client(srv.GetAvailableTransitions, f"/lidar/{name}")
            assert client.wait_for_service(60)
            rows = client.call(srv.GetAvailableTransitions.Request()).available_transitions
            assert len(rows) == count
        states = asker.create_client(srv.GetAvailableStates, "/lidar/get_available_states")
        assert states.wait_for_service(60)
        assert [s.id for s in states.call(srv.GetAvailableStates.Request()).available_states] == [
            *range(5),
            *range(10, 16),
        ]
        wait_until(lambda: len(events) == 8)
    assert [(e.transition.id, e.start_state.label, e.goal_state.label) for e in events[:2]] == [
        (1, "unconfigured", "configuring"),
        (10, "configuring", "inactive"),
    ]
    assert events[-1].transition.label == "transition_failure"
    assert events[0].timestamp > 1_700_000_000_000_000_000


def test_publishers_are_silent_and_timers_rest_unless_active(still, manual, there):
    received: list[str] = []
    ticks: list[str] = []
    with LifecycleNode("speaker", context=still) as node, metaros.Node("listener", context=there) as listener:
        publisher = node.create_lifecycle_publisher(String, "words")
        node.create_lifecycle_timer(0.5, lambda: ticks.append(node.state.label))
        node.on_deactivate(lambda: publisher.publish(String(data="last words")))
        listener.create_subscription(String, "words", lambda message: received.append(message.data))
        wait_until(lambda: there.graph.endpoints("/words", "MP") and still.graph.endpoints("/words", "MS"))
        ears, mouth = metaros.SingleThreadedExecutor(), metaros.SingleThreadedExecutor()
        ears.add_node(listener)
        mouth.add_node(node)

        def second() -> None:
            for _ in range(10):
                manual.advance(0.1)
                mouth.spin_once(0.0)

        publisher.publish(String(data="unconfigured"))
        node.trigger("configure")
        second()
        publisher.publish(String(data="inactive"))
        assert (publisher.silenced, ticks, publisher.topic) == (2, [], "/words")
        node.trigger("activate")
        second()
        publisher.publish(String(data="active"))
        node.trigger("deactivate")
        publisher.publish(String(data="inactive"))
        second()
        assert (publisher.silenced, ticks) == (3, ["active"] * 2)

        def both() -> bool:
            ears.spin_once(0.05)
            return len(received) == 2

        wait_until(both)
        publisher.close()
        ears.shutdown()
        mouth.shutdown()
    assert received == ["active", "last words"]


def test_a_callback_may_close_its_node(here):
    with LifecycleNode("brief", context=here) as node:
        node.on_configure(node.close)
        assert node.trigger("configure")
        assert node.closed
        assert node.state.label == "inactive"


def test_an_async_shutdown_cannot_be_awaited_by_close(here, caplog):
    with LifecycleNode("late", context=here) as node:

        @node.on_shutdown
        async def shut() -> None:
            await asyncio.sleep(60)

    assert node.closed
    assert node.state.label == "finalized"
    assert "an async def cannot be awaited here" in caplog.text


def test_the_same_node_without_a_lifecycle_of_its_own_is_whole(here):
    """Callbacks are probed for rules, which must change nothing: arguments, results, exceptions, builtins."""
    got: list[Any] = []
    with LifecycleNode("probed", context=here) as node:
        subscription = node.create_subscription(String, "words", got.append)
        assert subscription.callback(String(data="one")) is None
        pair = node.create_subscription(String, "words", lambda message, info: (message, info))
        assert pair.callback(1, 2) == (1, 2)
        with pytest.raises(ZeroDivisionError):
            node.create_timer(1.0, lambda: 1 / 0).callback()
    assert got == [String(data="one")]
