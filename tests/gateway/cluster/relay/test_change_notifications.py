"""What one gateway stores for another is told it at once."""

from __future__ import annotations

import asyncio

from gateway.cluster.relay_nudges import MOVED_S
from tests.support.relay_rig import ROBOT, relay_rig, settle


async def test_the_home_delivers_what_was_ordered_elsewhere_and_cuts_what_was_asked_for() -> None:
    async with relay_rig("abc") as rig:
        rig["b"].orders.waiting(ROBOT)
        rig["c"].recordings.waiting(ROBOT, "rec", 60)
        await settle()
        assert rig["a"].told == [("deliver", ROBOT), ("ask", "rec", 60)]
        assert rig["b"].told == rig["c"].told == []
        rig.link("")
        rig["b"].orders.waiting(ROBOT)  # it is told when it comes, by whoever has it then
        await settle()
        assert len(rig["a"].told) == 2


async def test_changes_of_commands_twins_and_recordings_are_told_to_all() -> None:
    async with relay_rig("abc") as rig:
        for number in range(3):
            rig["a"].orders.moved(f"c{number}")
            rig["a"].orders.moved(f"c{number}")
        rig["a"].recordings.deleted("rec")
        rig["a"].twins.courier.edited()
        await asyncio.sleep(MOVED_S * 1.5)
        await settle()
        told = [("stop", "rec"), ("look",), *(("changed", f"c{number}") for number in range(3))]
        assert rig["b"].told == rig["c"].told == told
        assert rig["a"].told == []


async def test_a_gateway_that_is_alone_tells_nobody() -> None:
    async with relay_rig("a") as rig:
        rig["a"].orders.moved("c")
        assert rig["a"].relays.nudges._telling is None
