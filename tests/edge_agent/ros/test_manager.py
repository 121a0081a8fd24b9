"""Robots' ROS graphs from both ends of the link: real nodes, the agent's desk, the gateway's part."""

from __future__ import annotations

import asyncio
from contextlib import aclosing, closing
from pathlib import Path
from typing import Any

import pytest

import metaros
from gateway.errors import CommandRefusedError, RobotOfflineError
from gateway.fleet.ros.errors import OfferRefusedError, UnknownActionError, UnknownGoalError
from gateway.fleet.ros.goal import Goal, GoalEvent
from gateway.fleet.ros.offer import OfferedGoal
from metaros._proto import link_pb2
from metaros.idl import message_class
from tests.edge_agent.conftest import Robot
from tests.support.nodes.counter import FIBONACCI, Counter
from tests.support.robots.custom_types_robot import custom_types_robot
from tests.support.robots.ros_pair import ROBOT, Half, RosPair, ros_pair
from tests.support.waiting import wait_until_async

TRIGGER = message_class("std_srvs/srv/Trigger")
ADD = message_class("example_interfaces/srv/AddTwoInts")


async def has_action(pair: RosPair, name: str = "/sim_1/count") -> None:
    """Until the gateway knows it."""
    await wait_until_async(lambda: name in pair.gateway.ros.graphs.of(ROBOT).actions)


async def all_of(goal: Goal) -> list[GoalEvent]:
    """Every event, to the end."""
    async with asyncio.timeout(60):
        return [event async for event in goal.events()]


async def test_the_graph_is_reported_whole_and_then_by_differences(robot: Robot) -> None:
    robot.node.create_publisher(str, "chatter")
    robot.node.create_service(TRIGGER, "reset", lambda request, response: response)
    other = robot.other("secret", "/sim_2")
    other.create_publisher(str, "talk")
    other.create_subscription(str, "/sim_1/chatter", lambda text: None)
    async with ros_pair(robot.context) as pair:
        graphs = pair.gateway.ros.graphs
        reported: list[str] = []
        stop = graphs.watch(reported.append)
        await wait_until_async(lambda: bool(graphs.of(ROBOT).subscribers.get("/sim_1/chatter")))
        graph = graphs.of(ROBOT)
        assert "/sim_1/base" in graph.nodes
        assert not any(node.startswith("/sim_2") for node in graph.nodes)
        assert [end.node for end in graph.publishers["/sim_1/chatter"]] == ["/sim_1/base"]
        assert [end.node for end in graph.subscribers["/sim_1/chatter"]] == [""]  # another robot's: without its name
        assert "/sim_2/talk" not in graph.publishers
        assert (graph.services["/sim_1/reset"].type_name, graph.services["/sim_1/reset"].nodes) == (
            "std_srvs/srv/Trigger",
            ("/sim_1/base",),
        )
        assert graph.publishers["/sim_1/chatter"][0].qos
        before = len(pair.frames)
        other.close()
        await wait_until_async(lambda: not graphs.of(ROBOT).subscribers.get("/sim_1/chatter"))
        assert graphs.of(ROBOT).revision > graph.revision
        late = [frame.graph for frame in pair.frames[before:] if frame.HasField("graph")]
        assert late
        assert not any(report.anew or report.endpoints for report in late)  # only what went
        assert set(reported) == {ROBOT}
        stop()
        pair.cut()
        assert graphs.of(ROBOT).nodes == graph.nodes  # it stays while the link is away
        pair.link()
        await wait_until_async(lambda: graphs.of(ROBOT).revision == 1)
        assert "/sim_1/chatter" in graphs.of(ROBOT).publishers


async def test_a_gateway_from_before_this_is_reported_nothing(robot: Robot) -> None:
    async with ros_pair(robot.context) as pair:
        await wait_until_async(lambda: pair.gateway.ros.graphs.of(ROBOT).revision)
        pair.cut()
        reported: list[Any] = []
        pair.manager.link_up(reported.append, link_pb2.Welcome(twin=True))
        robot.node.create_publisher(str, "news")
        await wait_until_async(lambda: pair.node.graph.endpoints("/sim_1/news"))
        await asyncio.sleep(0)
        pair.manager.link_down()
        pair.link()
        await wait_until_async(lambda: "/sim_1/news" in pair.gateway.ros.graphs.of(ROBOT).publishers)
        assert reported == []


async def test_a_service_is_called_by_its_name_alone(robot: Robot) -> None:
    def add(request: Any, response: Any) -> None:
        response.sum = request.a + request.b

    robot.node.create_service(ADD, "add", add)
    async with ros_pair(robot.context) as pair:
        await wait_until_async(lambda: "/sim_1/add" in pair.gateway.ros.graphs.of(ROBOT).services)
        command = await pair.gateway.fleet.calling(ROBOT, "add", request={"a": 2, "b": 3})
        assert command.call_service.type_name == "example_interfaces/srv/AddTwoInts"
        assert command.call_service.type_hash == ADD.__metaros_hash__


async def test_types_that_only_a_node_knows_are_called_sent_as_goals_and_published_in_json(
    robot: Robot, zenoh_router: str, tmp_path: Path
) -> None:
    async with ros_pair(robot.context) as pair:
        with custom_types_robot(zenoh_router, tmp_path / "log", namespace="/sim_1"):
            gateway = pair.gateway

            def known() -> bool:
                info = gateway.ros.graphs.of(ROBOT).services.get("/sim_1/wave")
                return info is not None and (info.type_name, info.type_hash) in gateway.ros.graphs.of(ROBOT).types

            await wait_until_async(known)
            graph = gateway.ros.graphs.of(ROBOT)
            info = graph.services["/sim_1/wave"]
            assert graph.schema("far_robot/srv/Wave_Request", info.type_hash).startswith("string<=8 how\nint16 times\n")
            call = (await gateway.fleet.calling(ROBOT, "wave", request={"times": 3})).call_service
            client = pair.node.create_raw_client(call.service, call.type_name, call.type_hash)
            with closing(client):
                answer = await client.call_async(call.request, 60)
            assert gateway.fleet.response(link_pb2.Command(call_service=call), answer, ROBOT) == {
                "done": True,
                "angle": 1.5,
            }

            await wait_until_async(lambda: gateway.ros.graphs.of(ROBOT).told("far_robot/action/Reach") is not None)
            joints = [{"angle": 1.0, "name": "a"}, {"angle": 2.0, "name": "b"}]
            goal = await gateway.ros.goals.send(ROBOT, "reach", goal={"path": joints}, timeout_s=60)
            events = await all_of(goal)
            assert (goal.type_name, events[-1].status, events[-1].value) == (
                "far_robot/action/Reach",
                "succeeded",
                {"error": 1.0},
            )
            assert [event.value["now"]["name"] for event in events if event.kind == "feedback"][-1] == "b"
            graph = gateway.ros.graphs.of(ROBOT)
            hash_text = graph.actions["/sim_1/reach"].type_hash
            assert graph.schema("far_robot/action/Reach_Goal", hash_text).startswith("uint8 FAST=2\n")

            await wait_until_async(lambda: gateway.ros.graphs.of(ROBOT).told("far_robot/msg/Squeeze") is not None)
            heard: list[str] = []
            robot.node.create_subscription(str, "squeezed", heard.append, metaros.qos_transient_local, dedicated=True)
            publish = (await gateway.fleet.publishing(ROBOT, "squeeze", message={"joint": {"name": "x"}})).publish
            assert publish.type_name == "far_robot/msg/Squeeze"
            raw = pair.node.create_raw_publisher(publish.topic, publish.type_name, publish.type_hash)
            with closing(raw):
                await wait_until_async(lambda: raw.events.matched == 1)
                await wait_until_async(lambda: (raw.publish(publish.payload), heard)[1])
            assert heard[0] == "x 5"


async def test_a_goal_is_followed_from_feedback_to_its_result(robot: Robot) -> None:
    counter = Counter(robot.node)
    async with ros_pair(robot.context) as pair:
        await has_action(pair)
        goals = pair.gateway.ros.goals
        goal = await goals.send(ROBOT, "count", goal={"order": 3}, by="ann")
        assert (goal.accepted, goal.type_name, goal.by) == (True, "example_interfaces/action/Fibonacci", "ann")
        seen: list[GoalEvent] = []

        async def follow() -> None:
            async with aclosing(goal.events()) as events:
                seen.extend([event async for event in events])

        following = asyncio.create_task(follow())
        for step in range(1, 4):
            counter.go.release()
            await wait_until_async(
                lambda step=step: (
                    goal.newest_feedback is not None and len(goal.newest_feedback.value["sequence"]) == step
                )
            )
        await asyncio.wait_for(following, 60)
        assert (goal.status, goal.result) == ("succeeded", {"sequence": [0, 1, 2]})
        assert (seen[-1].kind, seen[-1].value) == ("result", {"sequence": [0, 1, 2]})
        assert [0, 1, 2] in [event.value["sequence"] for event in seen if event.kind == "feedback"]
        assert goals.of(ROBOT) == [goals.find(ROBOT, goal.id)] == [goal]
        assert (await all_of(goal))[-1].value == {"sequence": [0, 1, 2]}  # also for who comes late
        assert await goals.cancel(ROBOT, goal.id) is False


async def test_feedback_is_reported_before_the_result_that_comes_right_behind_it(robot: Robot) -> None:
    counter = Counter(robot.node)
    async with ros_pair(robot.context) as pair:
        await has_action(pair)
        for _ in range(20):
            counter.go.release(3)
            goal = await pair.gateway.ros.goals.send(ROBOT, "count", goal={"order": 3})
            await all_of(goal)
            reported = [
                event for frame in pair.frames for event in frame.goals.events if event.goal_id.hex() == goal.id
            ]
            assert [event.ended for event in reported[-2:]] == [False, True]
            assert goal.newest_feedback is not None
            assert goal.newest_feedback.value == {"sequence": [0, 1, 2]}


async def test_a_goal_is_cancelled_rejected_or_unknown(robot: Robot) -> None:
    Counter(robot.node)
    async with ros_pair(robot.context) as pair:
        await has_action(pair)
        goals = pair.gateway.ros.goals
        goal = await goals.send(ROBOT, "count", goal={"order": 5})
        assert await goals.cancel(ROBOT, goal.id) is True
        assert (await all_of(goal))[-1].status == "canceled"
        rejected = await goals.send(ROBOT, "count", goal={"order": -1})
        assert (rejected.accepted, rejected.status, rejected.ended) == (False, "rejected", True)
        with pytest.raises(UnknownActionError):
            await goals.send(ROBOT, "other", goal={})
        with pytest.raises(CommandRefusedError, match="nobody serves"):
            await goals.send(ROBOT, "other", type_name="example_interfaces/Fibonacci", goal={"order": 1}, timeout_s=0.3)
        with pytest.raises(UnknownGoalError):
            goals.find(ROBOT, "00" * 16)
        assert [one.id for one in goals.of(ROBOT)] == [rejected.id, goal.id]


async def test_a_goal_outlives_its_link_and_another_gateway_finds_it(robot: Robot) -> None:
    counter = Counter(robot.node)
    async with ros_pair(robot.context) as pair:
        await has_action(pair)
        first, second = pair.gateway, Half(pair)
        short = await first.ros.goals.send(ROBOT, "count", goal={"order": 1})
        goal = await first.ros.goals.send(ROBOT, "count", goal={"order": 2})
        pair.cut()
        assert (goal.reachable, goal.ended) == (False, False)
        with pytest.raises(RobotOfflineError):
            await first.ros.goals.cancel(ROBOT, goal.id)
        counter.go.release()
        counter.go.release()
        counter.go.release()
        pair.link(second)
        await wait_until_async(
            lambda: len(second.ros.goals.of(ROBOT)) == 2 and all(one.ended for one in second.ros.goals.of(ROBOT))
        )
        found = second.ros.goals.find(ROBOT, goal.id)
        assert (found.status, found.result) == ("succeeded", {"sequence": [0, 1]})
        pair.cut()
        pair.link(first)  # back at the first: it hears the ends, too
        assert [event.status for event in await all_of(short)][-1] == "succeeded"
        assert [event.status for event in await all_of(goal)][-1] == "succeeded"


async def test_a_goal_is_lost_with_its_agent_or_its_server(robot: Robot) -> None:
    counter = Counter(robot.node)
    async with ros_pair(robot.context) as pair:
        await has_action(pair)
        goals = pair.gateway.ros.goals
        orphan = await goals.send(ROBOT, "count", goal={"order": 9})
        pair.cut()
        await pair.restart_agent()
        pair.link()
        end = (await all_of(orphan))[-1]
        assert (end.kind, end.status, orphan.result) == ("result", "lost", None)
        assert "started anew" in orphan.message
        goal = await goals.send(ROBOT, "count", goal={"order": 9})
        counter.server.close()
        assert (await all_of(goal))[-1].status in ("lost", "aborted")


async def test_a_client_serves_in_the_robots_graph(robot: Robot) -> None:
    async with ros_pair(robot.context) as pair:
        asked: list[Any] = []

        async def answer(request: Any) -> tuple[bool, Any]:
            asked.append(request)
            return (True, {"sum": request["a"] + request["b"]}) if request["a"] else (False, "nothing to add")

        offers = pair.gateway.ros.offers
        offer = await offers.service(ROBOT, "sum", "example_interfaces/srv/AddTwoInts", answer)
        client = robot.node.create_client(ADD, "sum")
        assert await asyncio.to_thread(client.wait_for_service, 60)
        assert (await client.call_async(ADD.Request(a=2, b=5), 60)).sum == 7
        with pytest.raises(metaros.errors.PeerError, match="nothing to add"):
            await client.call_async(ADD.Request(), 60)
        assert asked == [{"a": 2, "b": 5}, {"a": 0, "b": 0}]
        await wait_until_async(lambda: "/sim_1/sum" in pair.gateway.ros.graphs.of(ROBOT).services)
        with pytest.raises(OfferRefusedError, match="already"):
            await offers.service(ROBOT, "sum", "example_interfaces/srv/AddTwoInts", answer)
        robot.node.create_service(TRIGGER, "mine", lambda request, response: response)
        await wait_until_async(lambda: bool(pair.node.graph.endpoints("/sim_1/mine", "SS")))
        with pytest.raises(OfferRefusedError, match="taken"):
            await offers.service(ROBOT, "mine", "std_srvs/Trigger", answer)
        with pytest.raises(OfferRefusedError, match="namespace"):
            await offers.service(ROBOT, "/sim_2/sum", "example_interfaces/srv/AddTwoInts", answer)
        pair.cut()
        await wait_until_async(lambda: not client.service_is_ready())  # nobody could answer
        pair.link()
        assert await asyncio.to_thread(client.wait_for_service, 60)  # and it comes back by itself
        offer.close()
        await wait_until_async(lambda: not client.service_is_ready())
        assert offers.of(ROBOT) == []


async def test_a_client_runs_goals_of_the_robots_nodes(robot: Robot) -> None:
    async with ros_pair(robot.context) as pair:

        async def execute(goal: OfferedGoal) -> tuple[Any, Any]:
            if goal.goal["order"] > 5:
                begun.append(goal.goal["order"])
                await goal.cancelled()
                return "canceled", {"sequence": [9]}
            goal.feedback({"sequence": [1]})
            await wait_until_async(lambda: bool(received))
            return "succeeded", {"sequence": [1, 1]}

        received: list[Any] = []
        begun: list[int] = []
        await pair.gateway.ros.offers.action(ROBOT, "fib", "example_interfaces/action/Fibonacci", execute)
        client = robot.node.create_action_client(FIBONACCI, "fib")
        assert await asyncio.to_thread(client.wait_for_server, 60)
        goal = await client.send_goal(FIBONACCI.Goal(order=2), feedback=received.append, timeout_s=60)
        done = await goal.result(60)
        assert (done.status.name, list(done.result.sequence)) == ("SUCCEEDED", [1, 1])
        assert list(received[0].sequence) == [1]
        long = await client.send_goal(FIBONACCI.Goal(order=6), timeout_s=60)
        await wait_until_async(lambda: begun == [6])  # one that is cancelled before never runs
        assert await long.cancel(60)
        done = await long.result(60)
        assert (done.status.name, list(done.result.sequence)) == ("CANCELED", [9])
        lost = await client.send_goal(FIBONACCI.Goal(order=7), timeout_s=60)
        pair.cut()
        try:  # its server leaves the graph in the same moment: either way it ends, at once and plainly
            ended = (await lost.result(60)).status.name
        except metaros.errors.PeerError:
            ended = "ABORTED"
        assert ended == "ABORTED"
