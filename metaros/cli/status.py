"""`metaros status`: the running `metaros up`s of this user, and how their processes do."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from metaros.cli.shared.options import Format, FormatOption

if TYPE_CHECKING:
    from metaros.cli.shared.instances import Instance
    from metaros.cli.shared.output import Output

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("status")(status)


def status(output: FormatOption = Format.TEXT) -> None:
    """Show running instances with their ports, robots and processes; exit code 1 where there is none."""
    from metaros.cli.shared.instances import running_instances
    from metaros.cli.shared.output import Output

    out = Output(output)
    instances = running_instances()
    if out.json:
        out.objects([asdict(found) for found in instances])
    else:
        for found in instances:
            _show(out, found)
    if not instances:
        if not out.json:
            out.note("nothing runs; start it with: metaros up")
        raise typer.Exit(1)


def _viewers(found: Instance) -> list[tuple[str, str]]:
    """Where viewers connect, and a link that opens one of them in a browser."""
    from metaros.access.credentials import ca_for, key_for
    from metaros.cli.up.viewer_links import foxglove_page, make_ticket, socket_url

    rows = []
    if found.foxglove_port:
        key = key_for(found.url)
        ticket = make_ticket(found.url, key=key, ca=ca_for(found.url)) if key else ""
        rows.append(("Foxglove", socket_url(found.url, found.foxglove_port)))
        rows.append(("", foxglove_page(found.url, found.foxglove_port, ticket)))
    if found.rosbridge_port:
        rows.append(("rosbridge", socket_url(found.url, found.rosbridge_port)))
    return rows


def _show(out: Output, found: Instance) -> None:
    from metaros.access.credentials import key_for
    from metaros.cli.shared.output import human_seconds
    from metaros.cli.up.ready import robots_online
    from metaros.clock import SystemClock

    online = robots_online(found.url, key=key_for(found.url))
    age = human_seconds((SystemClock().wall_ns() - found.started_ns) / 1e9)
    robots = " ".join(name if name in online else f"{name} (offline)" for name in found.robots)
    router = "hosted here" if found.own_router else "joined"
    rows = (
        ("URL", out.style(found.url, "1;36")),
        ("Robots", robots or "none"),
        ("Zenoh", f"tcp/127.0.0.1:{found.zenoh_port}, router {router}, ROS domain {found.domain}"),
        ("Agents", f"127.0.0.1:{found.grpc_port}"),
        *_viewers(found),
        ("Data", found.data_dir),
    )
    out.line(f"{out.style('metaros up', '1')}  {found.state}, pid {found.pid}, for {age}")
    for label, value in rows:
        out.line(f"  {out.style(label.ljust(9), '2')} {value}")
    for row in found.processes:
        restarts = f", restarted {row['restarts']}×, last: {row['last_exit']}" if row["restarts"] else ""
        pid = f"pid {row['pid']}" if row["pid"] else ""
        out.line(f"  {out.style('process'.ljust(9), '2')} {row['name']!s:<16} {row['state']!s:<12} {pid}{restarts}")
    out.line()
