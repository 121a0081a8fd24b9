"""The agent asks the nodes of its robot for types that it has never seen."""

from __future__ import annotations

from pathlib import Path

from metaros.cdr import codec
from metaros.idl import Catalogue, add_schema_text, type_hash
from tests.edge_agent.conftest import Rig
from tests.support.robots.custom_types_robot import custom_types_robot
from tests.support.waiting import wait_until_async


async def test_the_schema_of_a_type_that_only_its_publisher_knows_reaches_the_gateway(
    agent: Rig, zenoh_router: str, tmp_path: Path
) -> None:
    with custom_types_robot(zenoh_router, tmp_path / "log", namespace="/sim_1"):

        def described() -> bool:
            channel = agent.channel("/sim_1/hand")
            return channel is not None and channel.schema_encoding == "ros2msg"

        await wait_until_async(described)
        channel = agent.channel("/sim_1/hand")
        assert channel is not None
        catalogue = Catalogue()
        add_schema_text(channel.schema_name, channel.schema.decode(), catalogue)
        assert type_hash("far_robot/msg/Hand", catalogue) == channel.type_hash
        agent.demand(channel, 20.0)
        live = agent.half.live[channel.channel_id]
        await wait_until_async(lambda: bool(live))
        hand = codec("far_robot/msg/Hand", catalogue).decode(live[0][1])
        assert ([finger.angle for finger in hand.fingers], hand.grip) == ([0.25, 1.5], "soft")
