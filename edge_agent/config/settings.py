"""The agent's settings: frozen, from a TOML file and the command line; the command line wins."""

from __future__ import annotations

import math
import socket
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args

from edge_agent.config.black_box import BlackBoxSettings, black_box_settings
from edge_agent.config.gateway_address import Compression, GatewayAddress, TransportSetting, parse_address
from edge_agent.config.node_settings import NodeSettings, allowed_entries, node_settings
from edge_agent.config.topic_table import DEFAULT_ACTUATORS, DEFAULT_TOPICS, Delivery, Seal, TopicRule
from edge_agent.outbox import CLASSES, ClassPolicy
from metaros.errors import ConfigError, MetarosError
from metaros.idl.globs import Glob
from metaros.idl.names import validate_namespace
from metaros.limits import LIMITS

__all__ = ["OutboxSettings", "Settings", "load_settings", "sanitised_hostname"]

ZenohProfile = Literal["auto", "open", "protected"]
CHOICES = {
    "transport": get_args(TransportSetting),
    "compression": get_args(Compression),
    "zenoh_profile": get_args(ZenohProfile),
}
DEFAULT_GATEWAY = "127.0.0.1:8081"
MAX_SYNC_MS = 10_000
MAX_BYTES = 1024 * 1024  # of the file
RULE_KEYS = {
    "match": str,
    "class": str,
    "max_rate_hz": float,
    "forward": bool,
    "fields": list,
    "metrics_rate_hz": float,
    "deadband": float,
    "deadband_max_s": float,
    "history_hz": float,
    "latest_only": bool,
    "seal": str,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class OutboxSettings:
    """Quotas of the outbox, of its reserve and of the live queue; how long a class gathers before its sync."""

    event_bytes: int = CLASSES["event"].quota_bytes
    metric_bytes: int = CLASSES["metric"].quota_bytes
    bulk_bytes: int = CLASSES["bulk"].quota_bytes
    reserve_bytes: int = LIMITS.outbox_reserve_bytes
    live_bytes: int = LIMITS.live_bytes
    event_sync_ms: int = round(CLASSES["event"].sync_s * 1000)
    metric_sync_ms: int = round(CLASSES["metric"].sync_s * 1000)
    bulk_sync_ms: int = round(CLASSES["bulk"].sync_s * 1000)
    idle_sync_ms: int = 1000  # of rows and of copies of live topics, while nobody watches

    @property
    def patience_s(self) -> float:
        """How much longer than else these gather then."""
        return max(0, self.idle_sync_ms - max(self.metric_sync_ms, self.bulk_sync_ms)) / 1000

    def classes(self) -> dict[str, ClassPolicy]:
        """The outbox's class table with these quotas and times."""
        policies = {
            "event": (self.event_bytes, self.event_sync_ms),
            "metric": (self.metric_bytes, self.metric_sync_ms),
            "bulk": (self.bulk_bytes, self.bulk_sync_ms),
        }
        return {
            name: replace(policy, quota_bytes=policies[name][0], sync_s=policies[name][1] / 1000)
            for name, policy in CLASSES.items()
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All settings of an agent. `name` is the robot's id at the gateway."""

    name: str = ""  # "" = the host's name
    namespace: str = "/"
    gateway: str = ""  # "" = the one that enrolled the robot, else DEFAULT_GATEWAY
    gateways: tuple[str, ...] = ()  # several that share one store, in order; instead of `gateway`
    transport: TransportSetting = "auto"
    compression: Compression = "none"  # of bulk and event batches on the wire
    zenoh_port: int = 7447
    zenoh_profile: ZenohProfile = "auto"  # protected for an enrolled robot whose router is or was, else open
    zenoh_credentials: Path | None = None  # None = ~/.metaros/zenoh
    exclude: tuple[str, ...] = ()
    host_metrics: bool = True
    trace_every: int = 1000  # one sample in so many is followed to viewers and rows; 0 = none
    actuators: tuple[str, ...] = DEFAULT_ACTUATORS
    talk: bool = True  # whether people may talk through its speaker, one at a time
    state_dir: Path | None = None  # None = ~/.metaros/agent/<name>
    status_file: Path | None = None
    seal_keyring: Path | None = None  # None = seal.keys in the state directory
    labels: Mapping[str, str] = field(default_factory=dict)
    topics: tuple[TopicRule, ...] = DEFAULT_TOPICS
    outbox: OutboxSettings = OutboxSettings()
    black_box: BlackBoxSettings = field(default_factory=BlackBoxSettings)
    nodes: NodeSettings = field(default_factory=NodeSettings)  # what may run here; [nodes] and [[allowed]]

    def addresses(self) -> list[GatewayAddress]:
        """The gateways to try, in order. Raises ConfigError."""
        return [
            parse_address(text).only(self.transport) for text in self.gateways or (self.gateway or DEFAULT_GATEWAY,)
        ]


def load_settings(path: Path | None = None, overrides: Mapping[str, Any] | None = None) -> Settings:
    """Read the file, if any, and lay what the command line gave (not None) over it.

    Raises:
        ConfigError: no such file, no TOML, an unknown key, a wrong type or a wrong value; names key and file.
    """
    where = str(path) if path else "command line"
    table = read_toml(path) if path else {}
    known = {item.name for item in fields(Settings)} | {"default_topics", "allowed"}
    for key in table:
        if key not in known:
            raise ConfigError(f"{where}: unknown key {key!r}; known are {', '.join(sorted(known))}")
    rules = topic_rules(table.pop("topics", []), where)
    allowed = allowed_entries(table.pop("allowed", []), where)
    table["nodes"] = NodeSettings(
        **node_settings(expect(table.get("nodes", {}), dict, "nodes", where), where), allowed=allowed
    )
    defaults = expect(table.pop("default_topics", True), bool, "default_topics", where)
    values = {key: convert(key, value, where) for key, value in table.items()}
    if {"gateway", "gateways"} <= values.keys():
        raise ConfigError(f"{where}: give gateway or gateways, not both")
    values["topics"] = (*rules, *(DEFAULT_TOPICS if defaults else ()))
    for key, value in (overrides or {}).items():
        if value is not None:
            if key in ("gateway", "gateways"):
                values.pop("gateway", None)
                values.pop("gateways", None)
            values[key] = convert(key, value, "command line")
    values["name"] = values.get("name") or sanitised_hostname()
    settings = Settings(**values)
    try:
        settings.addresses()
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error
    return settings


def read_toml(path: Path) -> dict[str, Any]:
    """The file's top table."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    if len(data) > MAX_BYTES:
        raise ConfigError(f"{path}: settings have at most {MAX_BYTES} bytes")
    try:
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: {error}") from error


def convert(key: str, value: Any, where: str) -> Any:
    """One setting's value, checked."""
    match key:
        case "namespace":
            return checked_namespace(expect(value, str, key, where), where)
        case "exclude" | "actuators":
            patterns = tuple(expect(item, str, key, where) for item in expect(value, (list, tuple), key, where))
            for pattern in patterns:
                checked_glob(pattern, key, where)
            return patterns
        case "zenoh_port":
            if not 1 <= expect(value, int, key, where) <= 65535:
                raise ConfigError(f"{where}: {key} must be 1 to 65535, not {value}")
            return value
        case "trace_every":
            if not 0 <= expect(value, int, key, where) <= 10**9:
                raise ConfigError(f"{where}: {key} must be 0 (none) to 1000000000, not {value}")
            return value
        case "gateway":
            return checked_gateway(expect(value, str, key, where), where)
        case "gateways":
            texts = [expect(item, str, key, where) for item in expect(value, (list, tuple), key, where)]
            if not texts:
                raise ConfigError(f"{where}: gateways must name at least one")
            return tuple(checked_gateway(text, where) for text in dict.fromkeys(texts))
        case "transport" | "compression" | "zenoh_profile":
            return chosen(key, value, where)
        case "host_metrics" | "talk":
            return expect(value, bool, key, where)
        case "labels":
            table = expect(value, dict, key, where)
            return {name: expect(text, str, f"labels.{name}", where) for name, text in table.items()}
        case "outbox":
            return outbox_settings(expect(value, dict, key, where), where)
        case "black_box":
            return black_box_settings(expect(value, dict, key, where), where)
        case "nodes":
            return value  # checked above, together with [[allowed]]
        case "status_file" | "state_dir" | "seal_keyring" | "zenoh_credentials":
            return Path(value)
        case _:
            return expect(value, str, key, where)


def expect(value: Any, kind: type | tuple[type, ...], key: str, where: str) -> Any:
    """The value, if it is of that type; integers pass as floats, booleans never as numbers."""
    kinds = kind if isinstance(kind, tuple) else (kind,)
    if float in kinds and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        names = " or ".join(item.__name__ for item in kinds)
        raise ConfigError(f"{where}: {key} must be {names}, not {value!r}")
    return value


def topic_rules(rows: Any, where: str) -> tuple[TopicRule, ...]:
    """The rows of [[topics]]."""
    return tuple(
        topic_rule(expect(row, dict, f"topics[{index}]", where), f"topics[{index}]", where)
        for index, row in enumerate(expect(rows, list, "topics", where))
    )


def topic_rule(row: dict[str, Any], key: str, where: str) -> TopicRule:
    """One row of [[topics]]."""
    for name, value in row.items():
        if name not in RULE_KEYS:
            raise ConfigError(f"{where}: unknown key {key}.{name}; known are {', '.join(RULE_KEYS)}")
        row[name] = expect(value, RULE_KEYS[name], f"{key}.{name}", where)
    if "match" not in row:
        raise ConfigError(f"{where}: {key}.match is missing")
    checked_glob(row["match"], f"{key}.match", where)
    delivery = row.pop("class", "auto")
    if delivery not in get_args(Delivery):
        raise ConfigError(f"{where}: {key}.class must be one of {', '.join(get_args(Delivery))}, not {delivery!r}")
    for name in ("max_rate_hz", "metrics_rate_hz", "deadband_max_s", "history_hz"):
        if not 0 <= row.get(name, 0.0) <= 1e6:
            raise ConfigError(f"{where}: {key}.{name} must be 0 to 1000000, not {row[name]}")
    row["fields"] = tuple(expect(path, str, f"{key}.fields", where) for path in row.get("fields", ()))
    check_reduction(row, delivery, key, where)
    check_seal(row, key, where)
    return TopicRule(delivery=delivery, **row)


def check_reduction(row: dict[str, Any], delivery: str, key: str, where: str) -> None:
    """A row's dead-band, its latest_only and its history_hz."""
    deadband = row.get("deadband", 0.0)
    if not 0 <= deadband < math.inf:
        raise ConfigError(f"{where}: {key}.deadband must be 0 or more, not {deadband}")
    if deadband and not row["fields"]:
        raise ConfigError(f"{where}: {key}.deadband needs {key}.fields: what is to move")
    if row.get("latest_only") and delivery == "event":
        raise ConfigError(f"{where}: {key}.latest_only cannot be with class event: every event is kept")
    if row.get("history_hz") and delivery in ("event", "bulk"):
        raise ConfigError(f"{where}: {key}.history_hz cannot be with class {delivery}: all of its samples are kept")
    if row.get("history_hz") and not row.get("forward", True):
        raise ConfigError(f"{where}: {key}.history_hz cannot be with forward = false: nothing leaves the robot")


def check_seal(row: dict[str, Any], key: str, where: str) -> None:
    """A row's seal, and that no series of a sealed topic leave the robot by mistake."""
    seal = row.get("seal", "clear")
    if seal not in get_args(Seal):
        raise ConfigError(f"{where}: {key}.seal must be one of {', '.join(get_args(Seal))}, not {seal!r}")
    if seal == "sealed" and row["fields"] and not row.get("deadband"):
        raise ConfigError(
            f'{where}: {key}.fields would go as readable series: say seal = "features", or leave them out'
        )
    if seal == "features" and not row["fields"]:
        raise ConfigError(f'{where}: {key}.seal = "features" needs {key}.fields: which go as readable series')


def outbox_settings(table: dict[str, Any], where: str) -> OutboxSettings:
    """The [outbox] table."""
    known = {item.name for item in fields(OutboxSettings)}
    for key, value in table.items():
        if key not in known:
            raise ConfigError(f"{where}: unknown key outbox.{key}; known are {', '.join(sorted(known))}")
        expect(value, int, f"outbox.{key}", where)
        if key.endswith("_ms") and not 1 <= value <= MAX_SYNC_MS:
            raise ConfigError(f"{where}: outbox.{key} must be 1 to {MAX_SYNC_MS} ms, not {value}")
        if key.endswith("_bytes") and value < 65536:
            raise ConfigError(f"{where}: outbox.{key} must be at least 65536 bytes, not {value}")
    return OutboxSettings(**table)


def checked_gateway(text: str, where: str) -> str:
    """A gateway's address."""
    try:
        parse_address(text)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error
    return text


def chosen(key: str, value: Any, where: str) -> str:
    """One of the words that a setting knows."""
    if value not in CHOICES[key]:
        raise ConfigError(f"{where}: {key} must be one of {', '.join(CHOICES[key])}, not {value!r}")
    return str(value)


def checked_namespace(namespace: str, where: str) -> str:
    """A ROS namespace."""
    try:
        validate_namespace(namespace)
    except MetarosError as error:
        raise ConfigError(f"{where}: namespace: {error}") from error
    return namespace


def checked_glob(pattern: str, key: str, where: str) -> None:
    """A topic pattern."""
    try:
        Glob(pattern)
    except MetarosError as error:
        raise ConfigError(f"{where}: {key}: {error}") from error


def sanitised_hostname() -> str:
    """This host's name as a robot id: letters, digits, `_`, `-` and `.`."""
    name = "".join(c if c.isascii() and (c.isalnum() or c in "_-.") else "_" for c in socket.gethostname())
    return name or "host"
