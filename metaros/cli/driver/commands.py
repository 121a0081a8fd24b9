"""`metaros driver`: the drivers that come with Meta-ROS, and one's own: list, look for devices, run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.driver.devices import new, probe
from metaros.cli.driver.header import header
from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, StatusFile, ZenohPort
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output
    from metaros.drivers import Manifest

__all__ = ["register"]

group = typer.Typer(name="driver", no_args_is_help=True, help="Drivers: list them, find devices, run one.")
group.command("probe")(probe)
group.command("new")(new)
group.command("header")(header)


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
def list_(output: FormatOption = Format.TEXT) -> None:
    """List the kinds of drivers there are."""
    from metaros.cli.shared.output import Output
    from metaros.drivers import all_manifests

    Output(output).listing(
        ("Driver", "What it is", "Quality", "Missing here"),
        [
            {
                "kind": kind.kind,
                "name": kind.name,
                "summary": kind.summary,
                "quality": kind.quality,
                "missing": _missing(kind),
            }
            for kind in all_manifests()
        ],
        lambda row: (row["kind"], row["name"], row["quality"], ", ".join(row["missing"])),
    )


@group.command("info")
def info(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="Such as camera, or ./folder of one of your own.")],
    output: FormatOption = Format.TEXT,
) -> None:
    """Show what a driver publishes, and its parameters."""
    from dataclasses import asdict

    from metaros.cli.shared.output import Output
    from metaros.drivers import manifest_of
    from metaros.drivers.manifest import read_manifest

    folder = _folder(kind)
    manifest = manifest_of(kind) if folder is None else read_manifest(folder.resolve() / "manifest.toml")
    out = Output(output)
    if out.json:
        out.objects(asdict(manifest) | {"missing": _missing(manifest)})
    else:
        _page(out, manifest)


@group.command("run")
def run(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="Such as camera, see `metaros driver list`, or ./folder of your own.")
    ],
    param: Annotated[
        list[str] | None,
        typer.Option("--param", "-p", metavar="NAME=VALUE", help="A setting; repeat it."),
    ] = None,
    namespace: Annotated[
        str, typer.Option("--namespace", metavar="NAMESPACE", help="Publish below this namespace.")
    ] = "/",
    name: Annotated[str, typer.Option("--name", metavar="NAME", help="The node's name; else the kind's.")] = "",
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    status_file: StatusFile = "",
) -> None:
    """Run a driver until Ctrl-C."""
    from metaros.cli.shared import running
    from metaros.cli.shared.connection import connect
    from metaros.drivers.registry import device_maker, maker_in, manifest_of
    from metaros.drivers.run import run_device
    from metaros.drivers.values import read_values

    folder = _folder(kind)
    manifest, make = (manifest_of(kind), device_maker(kind)) if folder is None else maker_in(folder)
    values = read_values(manifest, _parameters(param or []))  # what is wrong is said before anything is asked
    with running.stop_on_signals() as stop, connect(zenoh_port, domain) as context:
        running.write_status(running.status_file(status_file), driver=manifest.kind, namespace=namespace)
        run_device(manifest, make, values, context=context, namespace=namespace, name=name, stop=stop)
    typer.echo("stopped")


def _folder(kind: str) -> Path | None:
    """The folder that a KIND with a separator, or a dot at its beginning, names."""
    return Path(kind) if kind.startswith(".") or "/" in kind or "\\" in kind else None


def _missing(manifest: Manifest) -> list[str]:
    here = [] if manifest.runs_here else [f"runs on {' and '.join(manifest.platforms)} only"]
    return [*here, *manifest.missing()]


def _page(out: Output, manifest: Manifest) -> None:
    from metaros.drivers.manifest import QUALITIES

    out.line(f"{out.style(manifest.name, '1')}: {manifest.summary}")
    out.line(f"{manifest.quality}: {QUALITIES[manifest.quality]}")
    if missing := _missing(manifest):
        out.line(f"missing here: {', '.join(missing)}; pip install 'metaros[{manifest.extra}]'")
    for title, endpoints in (
        ("Publishes", manifest.publishes),
        ("Subscribes", manifest.subscribes),
        ("Services", manifest.services),
    ):
        if endpoints:
            out.line()
            out.table((title, "Type", ""), [(item.topic, item.type, item.summary) for item in endpoints])
    out.line()
    out.table(
        ("Parameter", "Type", "Default", "Meaning"),
        [(item.name, item.type, _shown(item.default), item.summary) for item in manifest.parameters],
    )


def _shown(value: Any) -> str:
    return '""' if value == "" else str(value).lower() if isinstance(value, bool) else str(value)


def _parameters(pairs: list[str]) -> dict[str, str]:
    """`NAME=VALUE` texts as a dictionary; ConfigError names the one that is none."""
    found: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise ConfigError(f"--param {pair!r} is not NAME=VALUE")
        found[name] = value
    return found
