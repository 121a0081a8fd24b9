"""Presence of robots at the gateways of the store. Inside a transaction of the caller's.

Gateways write down whose links begin and end, and that they live themselves: what a gateway said counts no longer than
that. Of two links of one robot the later one counts.
"""

from __future__ import annotations

from collections.abc import Mapping

from gateway.store.engine import StoreEngine

__all__ = ["forget_gateway", "read_presence", "say_alive", "write_presence"]


def say_alive(engine: StoreEngine, gateway: str, *, until_ns: int) -> None:
    """The gateway lives, and is believed so until then."""
    sql = "INSERT INTO gateways VALUES (?, ?) ON CONFLICT (gateway) DO UPDATE SET until_ns = excluded.until_ns"
    engine.execute(sql, gateway, until_ns)


def write_presence(engine: StoreEngine, gateway: str, changes: Mapping[str, tuple[bool, int]]) -> None:
    """Whether robots are linked to this gateway, and since when they are or are not."""
    rows = [(robot, gateway, int(online), since_ns) for robot, (online, since_ns) in sorted(changes.items())]
    engine.many(
        "INSERT INTO presence VALUES (?, ?, ?, ?) ON CONFLICT (robot) DO UPDATE"
        " SET gateway = excluded.gateway, online = excluded.online, since_ns = excluded.since_ns"
        " WHERE presence.gateway = excluded.gateway"
        " OR (excluded.online = 1 AND excluded.since_ns >= presence.since_ns)",
        rows,
    )


def forget_gateway(engine: StoreEngine, gateway: str, *, now_ns: int) -> None:
    """Nobody is linked to it: it ended, or has just begun."""
    sql = "UPDATE presence SET online = 0, since_ns = ? WHERE gateway = ? AND online = 1"
    engine.execute(sql, now_ns, gateway)


def read_presence(engine: StoreEngine, gateway: str, *, now_ns: int) -> dict[str, tuple[bool, int]]:
    """The robots of all other gateways: whether they are online, and since when; those of a dead one since its end."""
    rows = engine.fetch(
        "SELECT robot, online, since_ns, until_ns FROM presence JOIN gateways ON gateways.gateway = presence.gateway"
        " WHERE presence.gateway <> ?",
        gateway,
    )
    found = {}
    for robot, online, since_ns, until_ns in rows:
        alive = until_ns > now_ns
        found[robot] = (bool(online) and alive, since_ns if alive or not online else max(since_ns, until_ns))
    return found
