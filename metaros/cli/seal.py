"""`metaros seal`: the keys of sealed topics, and recordings opened with them. Nothing here speaks to a gateway."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from metaros.cli.shared.options import Format, FormatOption

__all__ = ["register"]

group = typer.Typer(name="seal", no_args_is_help=True, help="Sealed topics: their keys, and opening what was sealed.")
keys = typer.Typer(name="key", no_args_is_help=True, help="Keyrings: new, list, rotate.")
group.add_typer(keys)

KeyringPath = Annotated[Path, typer.Argument(metavar="KEYRING", help="The file of keys, mode 0600.")]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@keys.command("new")
def new(keyring: KeyringPath, output: FormatOption = Format.TEXT) -> None:
    """Make a keyring with one key. A file that is there is not overwritten."""
    from metaros.cli.shared.output import Output
    from metaros.clock import SystemClock
    from metaros.seal import Keyring, SealKey

    ring = Keyring((SealKey.make(SystemClock()),))
    ring.save(keyring, new=True)
    _say_current(Output(output), keyring, ring.current.key_id.hex())


@keys.command("list")
def list_(keyring: KeyringPath, output: FormatOption = Format.TEXT) -> None:
    """Show the keys' ids and ages, the one that seals first; never their secrets."""
    from metaros.cli.shared.output import Output, human_seconds
    from metaros.clock import SystemClock
    from metaros.seal import Keyring

    out, ring, now_ns = Output(output), Keyring.load(keyring), SystemClock().wall_ns()
    found = [(key.key_id.hex(), "seals" if key == ring.current else "opens", key) for key in reversed(ring.keys)]
    if out.json:
        out.objects([{"id": text, "use": use, "created_ns": key.created_ns} for text, use, key in found])
        return
    ages = [human_seconds(max(0, now_ns - key.created_ns) / 1e9) for _, _, key in found]
    out.table(("key", "use", "age"), [(*row[:2], age) for row, age in zip(found, ages, strict=True)])


@keys.command("rotate")
def rotate(
    keyring: KeyringPath,
    keep: Annotated[
        int | None, typer.Option("--keep", min=0, max=8, metavar="N", help="Keys before it that still open; 8.")
    ] = None,
    output: FormatOption = Format.TEXT,
) -> None:
    """Add a key that seals from now on; those before it still open what they sealed."""
    from metaros.cli.shared.output import Output
    from metaros.clock import SystemClock
    from metaros.limits import LIMITS
    from metaros.seal import Keyring, SealKey

    kept = LIMITS.seal_keys_kept if keep is None else keep
    ring = Keyring.load(keyring).rotated(SealKey.make(SystemClock()), keep=kept)
    ring.save(keyring)
    _say_current(Output(output), keyring, ring.current.key_id.hex())


@group.command("open")
def open_(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="An .mcap file, or a folder of them.")],
    target: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="The new, readable file.")],
    keyring: Annotated[Path, typer.Option("--keyring", "-k", metavar="KEYRING", help="The file of keys.")],
    robot: Annotated[
        str, typer.Option("--robot", metavar="ID", help="Whose it is; else what the recording says.")
    ] = "",
    sealed: Annotated[
        list[str] | None,
        typer.Option("--sealed", metavar="GLOB", help="Topics that are sealed for certain: else they are refused."),
    ] = None,
    output: FormatOption = Format.TEXT,
) -> None:
    """Open the sealed topics of a recording. What was changed, moved or repeated is left out, told, and ends with 1."""
    from metaros.cli.shared.output import Output, counted
    from metaros.record import open_bag
    from metaros.record.unseal import unseal
    from metaros.seal import Keyring

    out = Output(output)
    done = unseal(open_bag(bag), target, Keyring.load(keyring), robot=robot, sealed=sealed or ())
    refused = [{"topic": topic, "code": code, "count": count} for (topic, code), count in done.refused.items()]
    if out.json:
        out.object_line(
            {"path": str(target), "messages": done.file.messages, "opened": done.opened, "refused": refused}
        )
    else:
        out.line(f"{target}: {counted(done.file.messages, 'message')}, {done.opened} of them opened")
    for row in refused:
        out.note(f"{row['topic']}: {row['count']} refused: {row['code']}")
    if refused:
        raise typer.Exit(1)


def _say_current(out: object, keyring: Path, key_id: str) -> None:
    from metaros.cli.shared.output import Output

    assert isinstance(out, Output)
    if out.json:
        out.object_line({"path": str(keyring), "id": key_id})
    else:
        out.line(f"{keyring}: key {key_id} seals")
