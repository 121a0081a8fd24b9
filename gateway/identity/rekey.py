"""A new master key: what the old one sealed is sealed again, and the old one goes. It may be broken off anywhere.

1. The new key is on the disk as `master.key.next`. From now on it seals, and either opens.
2. In one transaction everything in the database is sealed by it.
3. It takes the old one's place, which is thereby gone.

Whoever is killed in between leaves a gateway that works, and begins again where it stopped.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from gateway.errors import DamagedError
from gateway.identity.authorities import PURPOSE as CA
from gateway.identity.keys import PURPOSE as API_KEY
from gateway.identity.master import MASTER_KEY, NEXT_KEY, MasterKey, make_key_file, read_key_file
from gateway.identity.root_key import sync_folder
from gateway.store.engine import StoreEngine
from metaros.errors import ConfigError

__all__ = ["Resealed", "begin", "finish", "reseal"]

# Everything in the database that a master key has sealed: purpose, table, its key, and the column.
SEALED = ((CA, "authorities", "authority", "sealed_key"), (API_KEY, "api_keys", "id", "sealed"))


class Resealed(NamedTuple):
    """How many secrets the new key has sealed, and which neither key opens: another master key's."""

    sealed: int
    foreign: tuple[str, ...]


def begin(folder: Path) -> tuple[MasterKey, MasterKey]:
    """The key that there is, and its successor, which is on the disk from now on. ConfigError: one of them is not."""
    old = MasterKey(read_key_file(folder / MASTER_KEY))
    try:
        if not (folder / NEXT_KEY).exists():
            make_key_file(folder / NEXT_KEY)
            sync_folder(folder)
    except OSError as error:
        raise ConfigError(f"the new master key cannot be made in {folder}: {error.strerror or error}") from error
    return old, MasterKey(read_key_file(folder / NEXT_KEY))


def reseal(engine: StoreEngine, old: MasterKey, new: MasterKey) -> Resealed:
    """Seal everything in the database by the new key; inside a writing transaction of the caller's."""
    done, foreign = 0, []
    for purpose, table, key, column in SEALED:
        rows = engine.fetch(f"SELECT {key}, {column} FROM {table} WHERE {column} IS NOT NULL ORDER BY {key}")
        for secret_id, sealed in ((str(row[0]), bytes(row[1])) for row in rows):
            if not sealed:
                continue
            plain = _opened(purpose, secret_id, sealed, old, new)
            if plain is None:
                foreign.append(f"{purpose} {secret_id}")
                continue
            again = new.seal(purpose, secret_id, plain)
            engine.execute(f"UPDATE {table} SET {column} = ? WHERE {key} = ?", again, secret_id)
            done += 1
    return Resealed(done, tuple(foreign))


def finish(folder: Path) -> None:
    """The new key takes the old one's place; nothing where it has already."""
    try:
        (folder / NEXT_KEY).replace(folder / MASTER_KEY)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ConfigError(f"the new master key cannot take its place in {folder}: {error.strerror}") from error
    sync_folder(folder)


def _opened(purpose: str, secret_id: str, sealed: bytes, *keys: MasterKey) -> bytes | None:
    for key in keys:
        try:
            return key.open(purpose, secret_id, sealed)
        except DamagedError:
            continue
    return None
