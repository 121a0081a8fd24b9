"""A robot's ROS graph in the API's documents: who is in it, its services, its actions and their goals."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from gateway.api.models.base import Exact
from metaros.limits import LIMITS

__all__ = [
    "ActionList",
    "Cancelled",
    "Endpoint",
    "Goal",
    "GoalList",
    "GoalRequest",
    "GraphAction",
    "GraphList",
    "GraphService",
    "RobotGraph",
    "ServiceList",
    "ServiceRequest",
]

Status = Literal["accepted", "executing", "canceling", "succeeded", "canceled", "aborted", "rejected", "lost"]


class Endpoint(Exact):
    """A publisher, a subscription, a service's server or client."""

    node: str = Field(examples=["/sim_1/base"], description="full name; empty: a node outside the robot's namespace")
    type: str = Field(examples=["nav_msgs/msg/Odometry"])
    type_hash: str = Field(examples=["RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"])
    qos: str = Field(examples=["::,10:,:,:,,"], description="as rmw_zenoh writes it")


class GraphTopic(Exact):
    """A topic, and who uses it."""

    topic: str = Field(examples=["/sim_1/odom"])
    types: list[str] = Field(examples=[["nav_msgs/msg/Odometry"]])
    publishers: list[Endpoint]
    subscribers: list[Endpoint]


class GraphService(Exact):
    """A service, and who serves and calls it."""

    service: str = Field(examples=["/sim_1/reset"])
    type: str = Field(examples=["std_srvs/srv/Trigger"])
    type_hash: str = Field(examples=["RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"])
    nodes: list[str] = Field(examples=[["/sim_1/base"]], description="that serve it")
    servers: list[Endpoint]
    clients: list[Endpoint]


class GraphAction(Exact):
    """An action, and the nodes that serve and use it."""

    action: str = Field(examples=["/sim_1/dock"])
    type: str = Field(examples=["example_interfaces/action/Fibonacci"])
    servers: list[str] = Field(examples=[["/sim_1/base"]])
    clients: list[str] = Field(examples=[[]])


class RobotGraph(Exact):
    """A robot's part of the ROS graph, as its agent told it last; revision 0: nothing was told yet."""

    robot: str = Field(examples=["sim_1"])
    revision: int = Field(examples=[3])
    nodes: list[str] = Field(examples=[["/sim_1/base"]])
    topics: list[GraphTopic]
    services: list[GraphService]
    actions: list[GraphAction]
    left_out: int = Field(examples=[0], description="nodes and endpoints beyond what a robot may tell")


class GraphList(Exact):
    """The graphs of robots."""

    robots: list[RobotGraph]
    next: str | None


class ServiceList(Exact):
    """The services of a robot, by name."""

    services: list[GraphService]
    next: str | None


class ActionList(Exact):
    """The actions of a robot, by name."""

    actions: list[GraphAction]
    next: str | None


class ServiceRequest(Exact):
    """Call a service."""

    type: str = Field(default="", examples=["std_srvs/srv/Trigger"], description="empty: as the robot's graph says")
    request: dict[str, Any] = Field(default_factory=dict, examples=[{}])
    timeout_s: float = LIMITS.command_timeout_s
    lease_id: str = Field(default="", description="of services that move the robot")
    sent_ns: int = Field(default=0, ge=0, lt=2**63)


class GoalRequest(Exact):
    """Begin a goal of an action."""

    type: str = Field(
        default="",
        examples=["example_interfaces/action/Fibonacci"],
        description="empty: as the robot's graph says",
    )
    goal: dict[str, Any] = Field(default_factory=dict, examples=[{"order": 5}])
    timeout_s: float = Field(default=LIMITS.command_timeout_s, gt=0, le=120, description="for the server to take it")
    lease_id: str = Field(default="", description="of actions that move the robot")
    sent_ns: int = Field(default=0, ge=0, lt=2**63)


class Goal(Exact):
    """A goal and how it stands."""

    goal: str = Field(examples=["0f8fad5bd9cb469fa16570867728950e"])
    robot: str = Field(examples=["sim_1"])
    action: str = Field(examples=["/sim_1/dock"])
    type: str = Field(examples=["example_interfaces/action/Fibonacci"])
    status: Status = Field(examples=["executing"])
    ended: bool = Field(examples=[False])
    reachable: bool = Field(examples=[True], description="false while the robot has no link: it goes on there")
    begun: str = Field(examples=["2026-11-22T00:00:00.000Z"])
    by: str = Field(examples=["ann"], description="who sent it through this gateway; empty: through another one")
    feedback: dict[str, Any] | None = Field(examples=[{"sequence": [0, 1, 1]}], description="the newest")
    result: dict[str, Any] | None = Field(examples=[None])
    message: str = Field(examples=[""], description="why it is as it is, where that needs saying")
    skipped: int = Field(examples=[0], description="messages of feedback that a newer one replaced on the robot")


class GoalList(Exact):
    """The goals of a robot, the newest first."""

    goals: list[Goal]
    next: str | None


class Cancelled(Exact):
    """Whether the server will stop the goal; its end is told like any other."""

    canceling: bool = Field(examples=[True])
