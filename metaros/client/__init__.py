"""A program's way to a gateway: robots, live and stored data, commands, over REST and gRPC.

    from metaros.client import Client

    with Client() as fleet:  # or Client("https://fleet.example", key="mrk_…")
        for robot in fleet.robots():
            print(robot.id, robot.online)
        for sample in fleet.subscribe("odom", robots="sim_*"):
            print(sample.robot, sample.message.pose.pose.position.x)

`AsyncClient` has the same verbs for asyncio. Errors are those of `metaros.errors`: what a gateway refuses is a
`RefusedError`, whose `reason` is the stable code of docs/reference/errors.md.
"""

from __future__ import annotations

from metaros.client.aio import AsyncClient
from metaros.client.alert_results import Alert, AlertChange, AlertFinding, AlertRemark
from metaros.client.goal import AsyncGoal, Goal
from metaros.client.results import Command, Event, GoalUpdate, Robot, Sample, Series, Values
from metaros.client.sync import Client

__all__ = [
    "Alert",
    "AlertChange",
    "AlertFinding",
    "AlertRemark",
    "AsyncClient",
    "AsyncGoal",
    "Client",
    "Command",
    "Event",
    "Goal",
    "GoalUpdate",
    "Robot",
    "Sample",
    "Series",
    "Values",
]
