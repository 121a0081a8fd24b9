"""A new master key: what the old one sealed is sealed again, and the old one goes. It may be broken off anywhere.

1. The new key is on the disk as `master.key.next`. From now on it seals, and either opens.
2. In one transaction everything in the database is sealed by it.
3. It takes the old one's place, which is thereby gone.

Whoever is killed in between leaves a gateway that works, and begins again where it stopped.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from gateway.identity.certificates.root_key import sync_folder
from gateway.identity.master import MasterKey, make_key_file, next_file, read_key_file
from gateway.identity.master_key_check import SEALED, note_key, opened
from gateway.store.engine import StoreEngine
from metaros.errors import ConfigError

__all__ = ["Resealed", "begin", "finish", "reseal"]


class Resealed(NamedTuple):
    """How many secrets the new key has sealed, and which neither key opens: another master key's."""

    sealed: int
    foreign: tuple[str, ...]


def begin(file: Path) -> tuple[MasterKey, MasterKey]:
    """The key that there is, and its successor, which is on the disk from now on. ConfigError: one of them is not."""
    old, successor = MasterKey(read_key_file(file)), next_file(file)
    try:
        if not successor.exists():
            make_key_file(successor)
            sync_folder(file.parent)
    except OSError as error:
        raise ConfigError(f"the new master key {successor} cannot be made: {error.strerror or error}") from error
    return old, MasterKey(read_key_file(successor))


def reseal(engine: StoreEngine, old: MasterKey, new: MasterKey) -> Resealed:
    """Seal everything in the database by the new key; inside a writing transaction of the caller's."""
    done, foreign = 0, []
    for purpose, table, key, column in SEALED:
        rows = engine.fetch(f"SELECT {key}, {column} FROM {table} WHERE {column} IS NOT NULL ORDER BY {key}")
        for secret_id, sealed in ((str(row[0]), bytes(row[1])) for row in rows):
            if not sealed:
                continue
            plain = opened(purpose, secret_id, sealed, old, new)
            if plain is None:
                foreign.append(f"{purpose} {secret_id}")
                continue
            again = new.seal(purpose, secret_id, plain)
            engine.execute(f"UPDATE {table} SET {column} = ? WHERE {key} = ?", again, secret_id)
            done += 1
    note_key(engine, new)
    return Resealed(done, tuple(foreign))


def finish(file: Path) -> None:
    """The new key takes the old one's place; nothing where it has already."""
    try:
        next_file(file).replace(file)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ConfigError(
            f"everything is sealed by {next_file(file)} now, which cannot take the place of {file}: {error.strerror}\n"
            "Put it there yourself, for every gateway of this store: until then either key opens."
        ) from error
    sync_folder(file.parent)
