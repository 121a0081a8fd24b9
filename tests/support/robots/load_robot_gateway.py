"""The real gateway program as a child of a fault campaign.

Who starts it need not import it: the fork server has done so (`PRELOAD`), which costs two seconds once.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from tests.support.robots.load_robot import die_with_parent, log_to

__all__ = ["PRELOAD", "GatewayConfig", "run_gateway"]

PRELOAD = (
    "tests.support.robots.load_robot_stack",
    "gateway.main",
)  # also what the campaign's own module imports, each time


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayConfig:
    """One life of the gateway."""

    folder: Path
    data_dir: Path
    http_port: int
    grpc_port: int
    host: str = "127.0.0.1"
    heartbeat_s: float = 5.0
    store_url: str = ""
    retention_rules: tuple[str, ...] = ()
    busy: bool = False  # compacts, merges and purges all the time
    robot_messages_per_s: int = 0  # no quota: a campaign's robot sends as fast as it can


def run_gateway(config: GatewayConfig) -> None:
    """The process."""
    import gateway.ingest.link_service
    import gateway.server.bind_address
    import gateway.settings
    from gateway.main import run
    from gateway.settings import Settings

    die_with_parent()
    log_to(config.folder / "gateway.log")
    if config.host != "127.0.0.1":  # in a network namespace of the campaign's own there is nobody else
        gateway.settings.is_loopback = gateway.server.bind_address.is_loopback = lambda host: True
        vars(gateway.ingest.link_service)["is_local_peer"] = lambda peer: True
    if config.busy:
        be_busy()
    known = {field.name for field in dataclasses.fields(Settings)}
    wanted = {
        "host": config.host,
        "port": config.http_port,
        "grpc_port": config.grpc_port,
        "data_dir": config.data_dir,
        "heartbeat_s": config.heartbeat_s,
        "store_url": config.store_url or None,
        "retention_bytes": 1 << 40,
        "retention_rules": config.retention_rules,
        "robot_messages_per_s": config.robot_messages_per_s,
        "robot_bytes_per_s": 0,
    }
    values = {name: value for name, value in wanted.items() if name in known and value is not None}
    run(Settings(**values), status_file=config.folder / "gateway.json")  # type: ignore[arg-type]


def be_busy() -> None:
    """Compact, merge and purge as fast as it goes."""
    import gateway.store.telemetry.compactor
    import gateway.store.writer
    from gateway.store.telemetry.compact import CompactPace
    from gateway.store.writer import Pace

    compaction = CompactPace(
        size_bytes=48 << 10, small_bytes=0, age_s=0.5, batches=400, look_every_s=0.005, sweep_every_s=0.3, retry_s=0.05
    )
    writing = Pace(merge_at_batches=32, merge_after_s=0.5, purge_every_s=0.2)
    vars(gateway.store.telemetry.compactor)["CompactPace"] = lambda: compaction
    vars(gateway.store.writer)["Pace"] = lambda: writing
