"""The topic table: which topics leave the robot, how, how often, and which of their fields are series.

Rows are tried in order and the first match wins; the settings' own rows come before these.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from metaros.idl.globs import Glob

__all__ = ["DEFAULT_ACTUATORS", "DEFAULT_TOPICS", "Delivery", "Seal", "TopicRule", "TopicTable", "series_name"]

Delivery = Literal["auto", "event", "bulk", "live"]
Seal = Literal["clear", "sealed", "features"]

DEFAULT_ACTUATORS: Final = ("**/cmd_vel",)  # topics that move the robot


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicRule:
    """One row. `auto` is live, but bulk without a rate limit when the publisher is reliable and keeps all."""

    match: str
    delivery: Delivery = "auto"
    max_rate_hz: float = 0.0  # 0 = no limit
    forward: bool = True
    fields: tuple[str, ...] = ()
    metrics_rate_hz: float = 2.0
    deadband: float = 0.0  # a sample, or a series' value, goes on only when a field moved by more; 0 = always
    deadband_max_s: float = 60.0  # and at the latest after so long; 0 = never without a move
    history_hz: float = 0.0  # of a live topic so many samples a second are kept, watched or not; 0 = none
    latest_only: bool = False  # bulk: while its class is behind only the newest sample waits
    seal: Seal = "clear"  # features: the samples are sealed, the series of `fields` are not

    @property
    def sealed(self) -> bool:
        """Whether the samples are sealed."""
        return self.seal != "clear"


DEFAULT_TOPICS: tuple[TopicRule, ...] = (
    TopicRule(
        match="**/odom",
        max_rate_hz=20.0,
        history_hz=2.0,
        fields=("pose.pose.position.x", "pose.pose.position.y", "twist.twist.linear.x", "twist.twist.angular.z"),
    ),
    TopicRule(match="**/scan", max_rate_hz=10.0, history_hz=1.0),
    TopicRule(
        match="**/battery_state",
        max_rate_hz=2.0,
        history_hz=1.0,
        fields=("percentage", "voltage", "current", "temperature"),
    ),
    TopicRule(match="**/imu", max_rate_hz=20.0, history_hz=1.0, fields=("angular_velocity.z", "linear_acceleration.x")),
    TopicRule(match="**/compressed", max_rate_hz=10.0, history_hz=0.2),
    TopicRule(match="**/video"),
    TopicRule(match="**/audio"),  # sound cannot be thinned
    TopicRule(match="**/audio/opus"),
    TopicRule(match="**/speaker/talk", forward=False),  # what people say goes to the robot, not back
    TopicRule(match="**/motor_temperature", max_rate_hz=2.0, fields=("temperature",)),
    TopicRule(match="**/host/cpu", max_rate_hz=2.0, fields=("percent", "load_1m")),
    TopicRule(match="**/host/memory", max_rate_hz=2.0, fields=("percent",)),
    TopicRule(match="**/host/disk", max_rate_hz=2.0, fields=("percent",)),
    TopicRule(match="**/host/temperature", max_rate_hz=2.0, fields=("celsius",)),
    TopicRule(match="**/host/network", max_rate_hz=2.0, fields=("rx_bytes_per_s", "tx_bytes_per_s")),
    TopicRule(match="**/diagnostics", max_rate_hz=50.0, history_hz=20.0),  # all devices share it, each once a second
    TopicRule(match="**/rosout", delivery="event"),
    TopicRule(match="**/functions/results", delivery="event"),
    TopicRule(match="**", max_rate_hz=10.0),
)


class TopicTable:
    """Finds a topic's row; patterns are compiled once."""

    def __init__(self, rules: Iterable[TopicRule] = DEFAULT_TOPICS) -> None:
        self._rules = tuple((Glob(rule.match), rule) for rule in rules)

    def rule(self, topic: str) -> TopicRule:
        """The first row that matches; a topic that no row names stays on the robot."""
        return self.find(topic) or TopicRule(match=topic, forward=False)

    def find(self, topic: str) -> TopicRule | None:
        """The first row that matches."""
        return next((rule for glob, rule in self._rules if glob.matches(topic)), None)


def series_name(topic: str, field: str, *, namespace: str) -> str:
    """`/sim_1/battery_state` and `percentage` in namespace /sim_1 make `battery_state.percentage`."""
    prefix = namespace.rstrip("/") + "/"
    relative = topic[len(prefix) :] if topic.startswith(prefix) else topic.lstrip("/")
    return f"{relative.replace('/', '.')}.{field}"
