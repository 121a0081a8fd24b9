"""`metaros driver`: run the drivers that come with Meta-ROS, each a node."""

from __future__ import annotations

import typer

__all__ = ["register"]

group = typer.Typer(name="driver", no_args_is_help=True, help="Drivers: list them, run one.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)
