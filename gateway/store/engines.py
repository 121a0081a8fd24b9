"""Opens the engine for a store's URL."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from gateway.errors import StoreError
from gateway.store.engine import StoreEngine, shown
from gateway.store.sqlite import SqliteEngine
from metaros.errors import ConfigError

__all__ = ["check_url", "open_engine"]

POSTGRES = ("postgresql://", "postgres://")


def check_url(url: str) -> None:
    """ConfigError when no engine is at this URL; "" is the file in the data directory."""
    if url and not url.startswith(POSTGRES):
        raise ConfigError("--store is a URL like postgresql://user@host:5432/database; without it a file is used")
    if url and find_spec("asyncpg") is None:
        raise ConfigError("PostgreSQL needs another module\ninstall it with: pip install 'metaros[postgres]'")


def open_engine(url: str, data_dir: Path) -> tuple[StoreEngine, str]:
    """The database with its tables up to date, and the store's id.

    Raises:
        ConfigError: the database cannot be used; a gateway does not start without its store.
    """
    check_url(url)
    if not url:
        file = SqliteEngine(data_dir)
        return _opened(file, str(data_dir))
    from gateway.store.postgres import PostgresEngine

    return _opened(PostgresEngine(url), shown(url))


def _opened(engine: StoreEngine, where: str) -> tuple[StoreEngine, str]:
    try:
        return engine, engine.open()
    except StoreError as error:
        engine.close()
        raise ConfigError(f"the store at {where} cannot be used: {error}") from error
