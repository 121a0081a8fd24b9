"""A robot in a process of its own: the agent's own pipeline, live queue and uplink, over gRPC.

    python -m load_tests.fanout.robot FOLDER PORT [--core 1]

Prints a line when the link is up; then each line of its input, JSON of a
`Load`, makes it take so many std_msgs/String as the tap would hand them over, each with its own stamp as digits, and it
prints how many they were. Only the tap itself is missing. The topic is live without a rate limit: it leaves while
viewers want it, waits for the agent's usual linger, and is stored nowhere, neither here nor in the gateway.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import time
from pathlib import Path

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from edge_agent.outbox import Outbox
from load_tests.fanout.load import SETTLE_S, STEP_S, Load, due_of, read_load
from metaros.idl import type_hash
from tests.support.robots.load_robot import TOPICS, LoadRobot, RobotConfig
from tests.support.waiting import wait_until_async

__all__ = ["ROBOT", "TEXT_TOPIC", "main"]

ROBOT, TEXT_TOPIC, TYPE = "bench", "/text", "std_msgs/msg/String"


class Speaker(LoadRobot):
    """Says texts on one topic."""

    outbox_type = Outbox

    def __init__(self, config: RobotConfig) -> None:
        super().__init__(config)
        queues = self.queues
        queues.channels.use(TopicTable((*TOPICS, TopicRule(match=TEXT_TOPIC, delivery="live"))))
        channel = queues.channels.observe(TEXT_TOPIC, TYPE, type_hash(TYPE), qos="", keeps_all=False)
        assert channel is not None
        self._channel = channel
        self._pipeline = Pipeline(
            self.outbox,
            queues.live,
            queues.linger,
            wake_writer=self.writer.wake,
            wake_uplink=self.uplink.wake,
            tracer=queues.tracer,
        )

    async def serve(self) -> None:
        """Until the input ends."""
        tasks = [asyncio.create_task(self.writer.run()), asyncio.create_task(self.uplink.run())]
        try:
            await wait_until_async(lambda: self.outbox.online)
            print("up", flush=True)
            while (load := await asyncio.to_thread(read_load)) is not None:
                print(await self._publish(load), flush=True)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _publish(self, load: Load) -> int:
        await wait_until_async(lambda: self._channel.selector.demand_hz is not None)
        sent, filler = 0, b"x" * (load.size - 21)
        for due in due_of(load):
            if due:
                now_s = time.monotonic()
                self._pipeline.take([self._arrival(filler, now_s) for _ in range(due)], now_s)
                sent += due
            await asyncio.sleep(STEP_S)
        await asyncio.sleep(SETTLE_S)
        return sent

    def _arrival(self, filler: bytes, now_s: float) -> Arrival:
        """A std_msgs/String in CDR whose text begins with the stamp's digits."""
        text = b"@%020d" % time.monotonic_ns() + filler + b"\0"
        payload = b"\0\1\0\0" + len(text).to_bytes(4, "little") + text
        return Arrival(self._channel, payload, len(payload), time.time_ns(), now_s)


def main(argv: list[str]) -> int:
    """Be the robot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="for the agent's files")
    parser.add_argument("port", type=int, help="of the gateway's endpoint for robots")
    parser.add_argument("--core", type=int, help="the one CPU that it runs on")
    options = parser.parse_args(argv)
    if options.core is not None:
        os.sched_setaffinity(0, {options.core})
    folder: Path = options.folder
    config = RobotConfig(
        folder=folder, state_dir=folder / "state", gateway=f"127.0.0.1:{options.port}", life=0, name=ROBOT
    )
    asyncio.run(Speaker(config).serve())
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
