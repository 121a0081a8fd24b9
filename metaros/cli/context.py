"""`metaros context`: gateways by name, and which of them the other commands ask."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from metaros.cli.shared.options import Format, FormatOption
from metaros.errors import ConfigError

__all__ = ["register"]

group = typer.Typer(name="context", no_args_is_help=True, help="Gateways by name: which one commands ask.")
Name = Annotated[str, typer.Argument(metavar="NAME", help="Of your choice, such as lab.")]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
def list_(output: FormatOption = Format.TEXT) -> None:
    """List them; the star marks the one that is asked."""
    from metaros.access.contexts import read
    from metaros.access.credentials import key_for
    from metaros.cli.shared.output import Output

    found = read()
    items = [
        {"name": name, "current": name == found.current, "gateway": url, "key": bool(key_for(url))}
        for name, url in sorted(found.gateways.items())
    ]
    Output(output).listing(
        ("", "Context", "Gateway", "Key"),
        items,
        lambda item: ("*" if item["current"] else " ", item["name"], item["gateway"], "yes" if item["key"] else "none"),
        empty="no contexts: metaros context add NAME --gateway URL",
    )


@group.command("add")
def add(
    name: Name,
    gateway: Annotated[str, typer.Option("--gateway", metavar="URL", help="Its address, as https://fleet.example.")],
    key: Annotated[
        bool, typer.Option("--key", help="Take an API key from the terminal, or from standard input, and keep it.")
    ] = False,
    ca: Annotated[
        Path | None, typer.Option("--ca", metavar="FILE", show_default=False, help="With --key: its root certificate.")
    ] = None,
    use: Annotated[bool, typer.Option("--use", help="Ask this one from now on.")] = False,
) -> None:
    """Remember a gateway under a name; the first one is used at once."""
    from metaros.access.contexts import change
    from metaros.access.credentials import save_key
    from metaros.cli.shared.gateway_http import GatewayClient
    from metaros.cli.shared.output import Output

    url = GatewayClient(gateway, key="").url  # says what is wrong with an address
    if ca is not None and not key:
        raise ConfigError("--ca is kept beside a key: add --key, or use `metaros --ca FILE …` each time")
    if key:
        save_key(url, _read_key(), ca=ca.resolve() if ca is not None else None)
    with change() as found:
        found.add(name, url)
        if use or not found.current:
            found.current = name
        current = found.current == name
    Output().note(f"{name} is {url}" + (", and the one that commands ask" if current else ""))


@group.command("use")
def use(name: Name) -> None:
    """Ask this one from now on."""
    from metaros.access.contexts import change
    from metaros.cli.shared.output import Output

    with change() as found:
        url = found.check(name)
        found.current = name
    Output().note(f"commands ask {name}, {url}")


@group.command("show")
def show(output: FormatOption = Format.TEXT) -> None:
    """Print the address that commands ask now."""
    from metaros.cli.shared.gateway_http import open_gateway
    from metaros.cli.shared.output import Output

    out, url = Output(output), open_gateway("").url
    if out.json:
        out.objects({"gateway": url})
    else:
        out.line(url)


@group.command("remove")
def remove(name: Name) -> None:
    """Forget the name; a key that is kept for its gateway stays."""
    from metaros.access.contexts import change

    with change() as found:
        found.remove(name)


def _read_key() -> str:
    """From a terminal without showing it, else the first line of standard input."""
    if sys.stdin.isatty():
        import getpass

        text = getpass.getpass("API key (mrk_…): ")
    else:
        text = sys.stdin.readline()
    key = text.strip()
    if not key.startswith("mrk_") or not key.isprintable() or " " in key:
        raise ConfigError("this is no API key: it begins with mrk_\n`metaros key create` makes one")
    return key
