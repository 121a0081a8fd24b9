"""Resolves `--data-dir`: a gateway's own directory, or the one within that of `metaros up`."""

from __future__ import annotations

from pathlib import Path

from metaros.errors import ConfigError

__all__ = ["gateway_dir"]


def gateway_dir(said: Path | None) -> Path | None:
    """The gateway's directory, for every option `--data-dir`; None stays None.

    `metaros up` keeps its gateway's data in a folder of its own directory. A store made beside that folder would be
    a second one, which no gateway reads.

    Raises:
        ConfigError: there is a store in both.
    """
    from metaros.cli.shared.instances import gateway_folder, is_data_dir

    if said is None:
        return None
    inner = gateway_folder(said)
    own, theirs = _has_store(said), _has_store(inner)
    if not theirs and (own or not is_data_dir(said)):
        return said
    if own:
        raise ConfigError(
            f"--data-dir {said}: there is a store in it, and that of `metaros up` in {inner}\n"
            f"Say --data-dir {inner}, or move the other one into a directory of its own."
        )
    return inner


def _has_store(folder: Path) -> bool:
    """Whether a gateway, or a command for one, has worked there; with PostgreSQL there is only its key."""
    from gateway.identity.master import MASTER_KEY
    from gateway.store.sqlite import DATABASE

    return any((folder / name).is_file() for name in (DATABASE, MASTER_KEY))
