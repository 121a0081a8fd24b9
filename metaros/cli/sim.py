"""`metaros sim`: simulated robots in a small warehouse."""

from __future__ import annotations

from typing import Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, StatusFile, ZenohPort

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("sim")(sim)


def sim(
    robots: Annotated[int, typer.Option("--robots", min=1, max=200, metavar="N", help="How many.")] = 3,
    first: Annotated[int, typer.Option("--first", min=1, metavar="N", help="Number of the first one.")] = 1,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="The same seed gives the same drive.")] = 1,
    fault: Annotated[
        list[str] | None, typer.Option("--fault", metavar="ROBOT:FAULT@SECONDS", help="sim_2:stuck_wheel@30")
    ] = None,
    resume_after: Annotated[
        float,
        typer.Option(
            "--resume-after", min=0.0, metavar="SECONDS", help="Autonomy is back so many seconds after a cmd_vel."
        ),
    ] = 10.0,
    camera: Annotated[bool, typer.Option("--camera/--no-camera", help="Render the forward cameras.")] = True,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    status_file: StatusFile = "",
) -> None:
    """Run simulated robots until Ctrl-C: odometry, laser, battery, IMU, camera, tf; they obey cmd_vel."""
    from metaros.cli.shared import running
    from metaros.cli.shared.connection import connect
    from metaros.sim import run_sim

    with running.stop_on_signals() as stop, connect(zenoh_port, domain) as context:
        last = f" … sim_{first + robots - 1}" if robots > 1 else ""
        typer.echo(f"simulating sim_{first}{last} on tcp/127.0.0.1:{zenoh_port}, domain {domain}  (Ctrl-C stops)")
        run_sim(
            robots=robots,
            first=first,
            seed=seed,
            context=context,
            faults=fault or (),
            resume_after_s=resume_after,
            camera=camera,
            status_file=running.status_file(status_file),
            stop=stop,
        )
    typer.echo("stopped")
