"""Graphs, goals and offers at every gateway, of a robot that is linked to one of them."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.cluster.relay.offers import OfferMerge
from gateway.errors import RobotOfflineError
from gateway.fleet.ros.errors import OfferRefusedError, UnknownGoalError
from gateway.fleet.ros.graph import RobotGraph
from gateway.fleet.ros.typed import encode
from metaros._proto import link_pb2
from metaros.idl import default_catalogue
from metaros.limits import Limits
from tests.support.gateways.relay_rig import ROBOT, RelayRig, relay_rig, settle

TRIGGER = "std_srvs/srv/Trigger"
FIBONACCI = "example_interfaces/action/Fibonacci"
MINE = link_pb2.TypeText(
    type_name="mine/srv/Dock",
    parts=[link_pb2.TypePart(name="mine/srv/Dock", text="int32 station\n---\nbool ok\n")],
)


def endpoint(number: int, name: str, kind: int = link_pb2.ENDPOINT_KIND_SERVER) -> link_pb2.GraphEndpoint:
    made = link_pb2.GraphEndpoint(number=number, node=f"/{ROBOT}/n", name=name, type_name=TRIGGER)
    made.kind = kind  # type: ignore[assignment]
    return made


def graph(**facts: Any) -> link_pb2.AgentFrame:
    return link_pb2.AgentFrame(graph=link_pb2.GraphReport(**facts))


def seen(rig: RelayRig, name: str) -> RobotGraph:
    return rig[name].ros.graphs.of(ROBOT)


async def test_every_gateway_has_the_graph_and_its_changes() -> None:
    async with relay_rig("abc") as rig:
        rig.says(graph(revision=1, anew=True, nodes=["/r1/n"], endpoints=[endpoint(1, "/r1/one")], types=[MINE]))
        rig.says(graph(revision=2, endpoints=[endpoint(2, "/r1/two")], endpoints_gone=[1]))
        await settle()
        for name in "abc":
            assert set(seen(rig, name).services) == {"/r1/two"}
            assert set(seen(rig, name).types) == {("mine/srv/Dock", "")}


async def test_a_gateway_that_comes_later_gets_the_whole_and_then_the_changes() -> None:
    async with relay_rig("a") as rig:
        rig.says(graph(revision=1, anew=True, nodes=["/r1/n"], endpoints=[endpoint(1, "/r1/one")], types=[MINE]))
        rig.says(goal(1))
        await settle()
        rig.add("b")
        await settle()
        assert (seen(rig, "b").nodes, set(seen(rig, "b").services)) == (("/r1/n",), {"/r1/one"})
        assert set(seen(rig, "b").types) == {("mine/srv/Dock", "")}
        assert [item.id for item in rig["b"].ros.goals.of(ROBOT)] == [f"{1:032x}"]
        rig.says(graph(revision=2, endpoints=[endpoint(2, "/r1/two")], endpoints_gone=[1]))
        await settle()
        assert set(seen(rig, "b").services) == {"/r1/two"}


async def test_a_gateway_that_missed_a_change_asks_for_the_whole() -> None:
    async with relay_rig() as rig:
        rig.says(graph(revision=1, anew=True, endpoints=[endpoint(1, "/r1/one")]))
        await settle()
        full: set[str] = rig["a"].relays.frames._mesh.full  # type: ignore[attr-defined]
        full.add("b")
        rig.says(graph(revision=2, endpoints=[endpoint(2, "/r1/two")]))
        await settle()
        assert set(seen(rig, "b").services) == {"/r1/one"}
        full.clear()
        rig.says(graph(revision=3, endpoints=[endpoint(3, "/r1/three")]))
        await settle()
        assert set(seen(rig, "b").services) == {"/r1/one", "/r1/two", "/r1/three"}
        rig.says(graph(revision=4, endpoints_gone=[1]))
        await settle()
        assert set(seen(rig, "b").services) == {"/r1/two", "/r1/three"}


async def test_a_robot_that_moves_has_the_graph_that_its_new_home_tells() -> None:
    async with relay_rig("abc") as rig:
        rig.says(graph(revision=1, anew=True, endpoints=[endpoint(1, "/r1/one")]))
        await settle()
        rig.link("b")
        rig.says(graph(revision=1, anew=True, endpoints=[endpoint(1, "/r1/other")]))
        rig.says(graph(revision=2, endpoints=[endpoint(2, "/r1/two")]))
        await settle()
        for name in "abc":
            assert set(seen(rig, name).services) == {"/r1/other", "/r1/two"}


async def test_types_of_a_large_graph_come_in_pieces_that_are_read_in_one_go_each() -> None:
    texts = []
    for number in range(30):
        text = link_pb2.TypeText(type_name=f"mine/srv/S{number}")
        text.parts.add(name=text.type_name, text="int32 a\n---\nbool ok\n")
        texts.append(text)
    async with relay_rig("a") as rig:
        rig.says(graph(revision=1, anew=True, more=True))
        for number, text in enumerate(texts):
            rig.says(graph(revision=1, more=number < len(texts) - 1, types=[text]))
        await settle()
        await settle()
        assert len(seen(rig, "a").types) == len(texts)
        reports = rig["a"].ros.graphs.reports(ROBOT)
        assert [report.anew for report in reports] == [True] + [False] * (len(reports) - 1)
        assert len(reports) > 1
        rig.add("b")
        for _ in range(5):
            await settle()
        assert seen(rig, "b").types.keys() == seen(rig, "a").types.keys()


# -- goals ---------------------------------------------------------------------------------------------------------


def goal(number: int, **facts: Any) -> link_pb2.AgentFrame:
    reported = {"action": "/r1/count", "type_name": FIBONACCI, "status": 2, **facts}
    event = link_pb2.GoalEvent(goal_id=number.to_bytes(16, "big"), **reported)
    return link_pb2.AgentFrame(goals=link_pb2.GoalEvents(events=[event]))


async def test_a_goal_that_was_sent_at_one_gateway_is_followed_at_all() -> None:
    async with relay_rig("abc") as rig:
        answer = encode(f"{FIBONACCI}_SendGoal_Response", {"accepted": True}, default_catalogue())
        rig.answer = lambda command: link_pb2.CommandResult(command_id=command.command_id, ok=True, payload=answer)
        sent = await rig["b"].ros.goals.send(ROBOT, "/r1/count", type_name=FIBONACCI, goal={"order": 3}, by="ann")
        rig.says(goal(int(sent.id, 16)))
        await settle()
        assert (sent.status, sent.by) == ("executing", "ann")
        for name in "ac":
            assert rig[name].ros.goals.find(ROBOT, sent.id).status == "executing"
        cancel = encode("action_msgs/srv/CancelGoal_Response", {}, default_catalogue())
        rig.answer = lambda command: link_pb2.CommandResult(command_id=command.command_id, ok=True, payload=cancel)
        await rig["c"].ros.goals.cancel(ROBOT, sent.id)
        assert rig.frames[-1].command.cancel_goal.goal_id == sent.goal_id
        rig.says(goal(int(sent.id, 16), ended=True, status=5))
        await settle()
        for name in "abc":
            assert rig[name].ros.goals.find(ROBOT, sent.id).status == "canceled"
        with pytest.raises(UnknownGoalError):
            rig["b"].ros.goals.find(ROBOT, "0" * 32)


async def test_goals_are_out_of_reach_at_every_gateway_while_there_is_no_link() -> None:
    async with relay_rig("abc") as rig:
        rig.says(goal(1))
        await settle()
        rig.link("")
        assert [rig[name].ros.goals.of(ROBOT)[0].reachable for name in "abc"] == [False] * 3
        rig.link("c")
        rig.says(goal(1))
        await settle()
        assert [rig[name].ros.goals.of(ROBOT)[0].reachable for name in "abc"] == [True] * 3


# -- offers ---------------------------------------------------------------------------------------------------------


class Agent:
    """The robot's part for offers: it takes what it is told, refuses a name that is served, and asks."""

    def __init__(self, rig: RelayRig) -> None:
        self._rig, self.serving, self.answers = rig, dict[int, str](), list[link_pb2.OfferAnswer]()
        hear = rig.hear

        def received(frame: link_pb2.GatewayFrame) -> None:
            hear(frame)
            if frame.HasField("offers"):
                self._take(list(frame.offers.offers))
            elif frame.HasField("offer_answer"):
                self.answers.append(frame.offer_answer)

        rig.hear = received  # type: ignore[method-assign]

    def _take(self, wanted: list[link_pb2.Offer]) -> None:
        self.serving = {number: name for number, name in self.serving.items() if number in {o.number for o in wanted}}
        states = []
        for offer in wanted:
            if offer.number in self.serving:
                continue
            taken = offer.name in self.serving.values()
            states.append(link_pb2.OfferState(number=offer.number, code="taken" if taken else ""))
            if not taken:
                self.serving[offer.number] = offer.name
        if states:
            self._rig.says(link_pb2.AgentFrame(offer_states=link_pb2.OfferStates(states=states)))

    def ask(self, ask: int, name: str, **facts: Any) -> None:
        number = next((number for number, served in self.serving.items() if served == name), 0)
        asked = link_pb2.OfferAsked(number=number, ask=ask, **facts)
        asked.request = encode(f"{TRIGGER}_Request", {}, default_catalogue())
        self._rig.says(link_pb2.AgentFrame(asked=asked))

    def lose(self) -> None:
        self.serving.clear()


def says(text: str) -> Any:
    async def answer(request: Any) -> tuple[bool, Any]:
        return True, {"success": True, "message": text}

    return answer


async def test_clients_of_several_gateways_serve_in_one_graph_and_each_gets_its_asks() -> None:
    async with relay_rig("abc") as rig:
        agent = Agent(rig)
        for name in "abc":
            await rig[name].ros.offers.service(ROBOT, f"of_{name}", TRIGGER, says(f"I am {name}"))
        assert sorted(agent.serving.values()) == ["/r1/of_a", "/r1/of_b", "/r1/of_c"]
        for ask, name in enumerate("cab", 1):
            agent.ask(ask, f"/r1/of_{name}")
        await settle()
        said = {answer.ask: answer.payload for answer in agent.answers}
        assert all(f"I am {name}".encode() in said[ask] for ask, name in enumerate("cab", 1))
        mine = rig["b"].ros.offers.of(ROBOT)[0]
        mine.close()
        await settle()
        assert sorted(agent.serving.values()) == ["/r1/of_a", "/r1/of_c"]


async def test_a_name_that_is_served_at_another_gateway_is_taken() -> None:
    async with relay_rig("ab") as rig:
        agent = Agent(rig)
        await rig["a"].ros.offers.service(ROBOT, "stop", TRIGGER, says("a"))
        with pytest.raises(OfferRefusedError, match="taken"):
            await rig["b"].ros.offers.service(ROBOT, "stop", TRIGGER, says("b"))
        await settle()
        assert list(agent.serving.values()) == ["/r1/stop"]


async def test_offers_follow_the_robot_to_its_next_home() -> None:
    async with relay_rig("abc") as rig:
        agent = Agent(rig)
        await rig["a"].ros.offers.service(ROBOT, "of_a", TRIGGER, says("a"))
        await rig["b"].ros.offers.service(ROBOT, "of_b", TRIGGER, says("b"))
        agent.lose()
        rig.link("b")
        await settle()
        assert sorted(agent.serving.values()) == ["/r1/of_a", "/r1/of_b"]
        agent.ask(1, "/r1/of_a")
        await settle()
        assert agent.answers[-1].ok


async def test_a_gateway_that_dies_serves_nothing_and_who_asked_it_hears_so() -> None:
    async with relay_rig("abc") as rig:
        agent = Agent(rig)

        async def never(request: Any) -> tuple[bool, Any]:
            await asyncio.Event().wait()
            return True, {}

        await rig["a"].ros.offers.service(ROBOT, "of_a", TRIGGER, says("a"))
        await rig["b"].ros.offers.service(ROBOT, "of_b", TRIGGER, never)
        agent.ask(7, "/r1/of_b")
        await settle()
        half = rig["b"]
        rig.kill("b")
        await settle()
        assert list(agent.serving.values()) == ["/r1/of_a"]
        assert [(answer.ask, answer.ended, answer.ok) for answer in agent.answers] == [(7, True, False)]
        for task in list(half.ros.offers._tasks.values()):
            task.cancel()
        await settle()


async def test_an_offer_on_a_robot_without_a_link_is_refused() -> None:
    async with relay_rig("ab") as rig:
        rig.link("")
        with pytest.raises(RobotOfflineError):
            await rig["b"].ros.offers.service(ROBOT, "x", TRIGGER, says("b"))


def offers(*numbers: int) -> link_pb2.Offers:
    return link_pb2.Offers(offers=[link_pb2.Offer(number=number, name=f"/{number}") for number in numbers])


def test_the_robots_numbers_are_its_own_and_stay() -> None:
    merge = OfferMerge()
    merge.put("r", "a", offers(1, 2))
    merge.put("r", "b", offers(1))
    first = {offer.number: offer.name for offer in merge.list_of("r").offers}
    assert len(first) == 3
    merge.put("r", "a", offers(2, 3))
    then = {offer.number: offer.name for offer in merge.list_of("r").offers}
    assert {number: name for number, name in then.items() if number in first}.items() <= first.items()
    assert len(then) == 3
    reported = link_pb2.OfferStates(states=[link_pb2.OfferState(number=number) for number in then])
    found = merge.states("r", reported)
    assert {gateway: sorted(state.number for state in said.states) for gateway, said in found.items()} == {
        "a": [2, 3],
        "b": [1],
    }


def test_what_is_beyond_the_robots_room_is_refused_to_the_one_who_came_last() -> None:
    merge = OfferMerge(limits=Limits(offers=3))
    assert merge.put("r", "a", offers(1, 2)) is None
    refused = merge.put("r", "b", offers(1, 2))
    assert refused is not None
    assert [(state.number, state.code) for state in refused.states] == [(2, "too_many")]
    assert len(merge.list_of("r").offers) == 3


def test_only_who_was_asked_may_answer() -> None:
    merge = OfferMerge()
    merge.put("r", "a", offers(1))
    asked = link_pb2.OfferAsked(number=merge.list_of("r").offers[0].number, ask=5)
    assert (merge.asked("r", asked), asked.number) == ("a", 1)
    assert merge.asked("r", link_pb2.OfferAsked(ask=5, cancel=True)) == "a"
    assert not merge.answered("r", "b", link_pb2.OfferAnswer(ask=5, ended=True))
    assert merge.answered("r", "a", link_pb2.OfferAnswer(ask=5))
    assert merge.answered("r", "a", link_pb2.OfferAnswer(ask=5, ended=True))
    assert not merge.answered("r", "a", link_pb2.OfferAnswer(ask=5, ended=True))
