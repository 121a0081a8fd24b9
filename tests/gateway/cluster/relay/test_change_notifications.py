"""What one gateway stores for another is told it at once."""

from __future__ import annotations

import asyncio

from gateway.cluster.relay.change_notifications import MOVED_S
from tests.support.gateways.relay_rig import ROBOT, relay_rig, settle


async def test_the_home_delivers_what_was_ordered_remote_and_cuts_what_was_asked_for() -> None:
    async with relay_rig("abc") as rig:
        rig["b"].command_manager.waiting(ROBOT)
        rig["c"].recordings.waiting(ROBOT, "rec", 60)
        await settle()
        assert rig["a"].told == [("deliver", ROBOT), ("ask", "rec", 60)]
        assert rig["b"].told == rig["c"].told == []
        rig.link("")
        rig["b"].command_manager.waiting(ROBOT)  # it is told when it comes, by whoever has it then
        await settle()
        assert len(rig["a"].told) == 2


async def test_changes_of_commands_twins_and_recordings_are_reported_to_all() -> None:
    async with relay_rig("abc") as rig:
        for number in range(3):
            rig["a"].command_manager.moved(f"c{number}")
            rig["a"].command_manager.moved(f"c{number}")
        rig["a"].recordings.deleted("rec")
        rig["a"].twins.sender.edited()
        await asyncio.sleep(MOVED_S * 1.5)
        await settle()
        reported = [("stop", "rec"), ("look",), *(("changed", f"c{number}") for number in range(3))]
        assert rig["b"].told == rig["c"].told == reported
        assert rig["a"].told == []


async def test_a_gateway_that_is_alone_tells_nobody() -> None:
    async with relay_rig("a") as rig:
        rig["a"].command_manager.moved("c")
        assert rig["a"].relays.notifications._telling is None
