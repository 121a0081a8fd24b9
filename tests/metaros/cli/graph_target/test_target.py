"""A command's own parameters and the shared options, put together for typer."""

from __future__ import annotations

from typing import Annotated

import typer
from typer.testing import CliRunner

from metaros.cli.graph_target.target import OPTIONS, GraphTarget, graph_command


def app() -> typer.Typer:
    """A program with one command."""
    made = typer.Typer()

    @made.command()
    @graph_command
    def open_graph(target: GraphTarget, name: str, loud: Annotated[bool, typer.Option("--loud")] = False) -> None:
        """Say what was given."""
        typer.echo(f"{name} {loud} {target.zenoh_port} {target.domain} {target.spin_time} {target.out.json}")

    return made


def test_own_arguments_come_first_and_the_rest_makes_the_visit() -> None:
    done = CliRunner().invoke(app(), ["odom", "--loud", "--zenoh-port", "7000", "--domain", "3", "-o", "json"])
    assert done.output == "odom True 7000 3 1.0 True\n"


def test_defaults_and_the_environment() -> None:
    none = {"METAROS_ZENOH_PORT": None, "ROS_DOMAIN_ID": None}
    assert CliRunner(env=none).invoke(app(), ["odom"]).output == "odom False 7447 0 1.0 False\n"
    there = {"METAROS_ZENOH_PORT": "7001", "ROS_DOMAIN_ID": "5"}
    assert CliRunner(env=there).invoke(app(), ["odom"]).output == "odom False 7001 5 1.0 False\n"


def test_a_bad_value_is_refused_and_the_help_is_the_commands_own() -> None:
    assert CliRunner().invoke(app(), ["odom", "--zenoh-port", "0"]).exit_code == 2
    page = CliRunner(env={"NO_COLOR": "1", "COLUMNS": "100"}).invoke(app(), ["--help"]).output
    assert "Say what was given." in page
    assert all(f"--{name.replace('_', '-')}" in page for name, _, _ in OPTIONS)
