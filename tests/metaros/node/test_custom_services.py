"""`@service` and `@action` classes between nodes, and peers that know them by name alone."""

from __future__ import annotations

from typing import Any

import metaros
from metaros.idl import message_class
from tests.metaros.node.action.test_actions import spinning
from tests.support.waiting import wait_until


@metaros.message(name="crane_test/msg/Load")
class Load:
    """What hangs on it."""

    kilograms: float = 1.0


@metaros.service(name="crane_test/srv/Weigh")
class Weigh:
    """Answers with the heaviest."""

    class Request:
        loads: list[Load]

    class Response:
        heaviest: Load


@metaros.action(name="crane_test/action/Lift")
class Lift:
    """Lifts a load."""

    class Goal:
        load: Load

    class Result:
        metres: float

    class Feedback:
        metres: float


def weigh(request: Any, response: Any) -> None:
    response.heaviest = max(request.loads, key=lambda load: load.kilograms)


def lift(goal: Any) -> Any:
    goal.publish_feedback(Lift.Feedback(metres=1.0))
    return Lift.Result(metres=goal.request.load.kilograms / 2)


def test_they_work_across_the_wire_and_peers_can_ask_for_them(here, there):
    with metaros.Node("crane", context=here) as crane, metaros.Node("user", context=there) as user:
        crane.create_service(Weigh, "/weigh", weigh)
        crane.create_action_server(Lift, "/lift", lift)
        with spinning(crane):
            # The one that knows the classes.
            request = Weigh.Request(loads=[Load(kilograms=2.0), Load(kilograms=5.0)])
            answer = user.create_client(Weigh, "/weigh").call(request, timeout_s=60.0)
            assert (type(answer), answer.heaviest) == (Weigh.Response, Load(kilograms=5.0))
            with spinning(user):
                client = user.create_action_client(Lift, "/lift")
                fed: list[Any] = []
                assert client.wait_for_server(60.0)
                goal = client.send_goal(Lift.Goal(load=Load(kilograms=3.0)), feedback=fed.append, timeout_s=60.0).wait()
                result = goal.result(60.0).wait()
                assert (type(result.result), result.result.metres) == (Lift.Result, 1.5)
                wait_until(lambda: fed == [Lift.Feedback(metres=1.0)])
            # What others get to hear who ask by hash: types of services stand in tokens as a whole, of actions by part.
            asked = message_class("type_description_interfaces/srv/GetTypeDescription")
            describe = user.create_client(asked, "/crane/get_type_description")
            for name in (
                "crane_test/srv/Weigh",
                *(f"crane_test/action/Lift_{part}" for part in ("SendGoal", "GetResult", "FeedbackMessage")),
            ):
                hash_text = {item.type_name: item.type_hash for item in user.graph.endpoints()}[name]
                told = describe.call(
                    asked.Request(type_name=name, type_hash=hash_text, include_type_sources=True), timeout_s=60.0
                )
                parts = [part.type_name for part in told.type_description.referenced_type_descriptions]
                assert told.successful, told.failure_reason
                assert "crane_test/msg/Load" in parts or name.endswith(("GetResult", "FeedbackMessage"))
