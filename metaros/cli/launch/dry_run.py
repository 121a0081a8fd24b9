"""`metaros launch --dry-run`: what would be started, in which order, and how it would be kept."""

from __future__ import annotations

import shlex
import sys
from typing import TYPE_CHECKING

from metaros.cli.launch.plan import launches
from metaros.cli.shared.output import Output
from metaros.supervise.restart_policy import Restart

if TYPE_CHECKING:
    from metaros.cli.launch.plan import Place
    from metaros.supervise import Launch, LaunchTable, NodeRow

__all__ = ["show"]


def show(table: LaunchTable, place: Place) -> None:
    """Print it; one paragraph a node."""
    out = Output()
    out.line(f"{out.style(table.path.name, '1')}  {len(table.nodes)} nodes, logs in {place.log_dir}")
    for row, launch in zip(table.nodes, launches(table, place), strict=True):
        out.line()
        out.line(f"{out.style(row.name, '1;36')}  {_kept(row)}")
        if row.after:
            with_them = ", restarted with them" if row.rest_for_one else ""
            out.line(f"  after    {', '.join(row.after)}{with_them}")
        out.line(f"  command  {_command(launch)}")


def _command(launch: Launch) -> str:
    argv = ["python" if word == sys.executable else word for word in launch.argv]
    return shlex.join(argv)


def _kept(row: NodeRow) -> str:
    words = {Restart.ALWAYS: "always restarted", Restart.ON_FAILURE: "restarted when it fails"}
    parts = [words.get(row.policy.restart, "started once")]
    if row.policy.restart is not Restart.NEVER and not row.policy.critical:
        parts.append(f"quarantined after {row.policy.window_exits} exits in {row.policy.window_s:.0f} s")
    if row.policy.critical:
        parts.append("critical")
    if row.nice:
        parts.append(f"nice {row.nice}")
    if not row.heartbeat:
        parts.append("no heartbeat")
    return ", ".join(parts)
