"""Gateways by name: `~/.metaros/contexts.json` says which there are, and which one commands ask.

Keys are not here: they stay with their gateway's address in `~/.metaros/credentials`.
"""

from __future__ import annotations

import json
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from metaros.concurrency.file_lock import file_lock
from metaros.errors import ConfigError

__all__ = ["Contexts", "change", "contexts_file", "current_gateway", "read"]

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,62}")
ENTRIES = 256


@dataclass(slots=True)
class Contexts:
    """Addresses by name; `current` is the name that commands use, "" for none."""

    current: str = ""
    gateways: dict[str, str] = field(default_factory=dict)

    def check(self, name: str) -> str:
        """The address behind a name; ConfigError with the names there are."""
        if (url := self.gateways.get(name)) is None:
            known = ", ".join(sorted(self.gateways)) or "none yet: metaros context add NAME --gateway URL"
            raise ConfigError(f"there is no context {name!r}\nknown: {known}")
        return url

    def add(self, name: str, url: str) -> None:
        """Remember, or move, one."""
        if _NAME.fullmatch(name) is None:
            raise ConfigError(f"context {name[:70]!r}: up to 63 letters, digits, '.', '-' and '_', no mark first")
        if name not in self.gateways and len(self.gateways) >= ENTRIES:
            raise ConfigError(f"there are {ENTRIES} contexts: metaros context remove NAME")
        self.gateways[name] = url

    def remove(self, name: str) -> None:
        """Forget one."""
        self.check(name)
        del self.gateways[name]
        if self.current == name:
            self.current = ""


def contexts_file() -> Path:
    """Where they are."""
    return Path.home() / ".metaros" / "contexts.json"


def current_gateway() -> str:
    """The address of the context that is meant: of `metaros --context NAME`, else of the current one; "" for none.

    Raises:
        ConfigError: there is no context of that name, or the file is damaged.
    """
    found = read()
    name = os.environ.get("METAROS_CONTEXT", "").strip() or found.current
    return found.check(name) if name else ""


def read() -> Contexts:
    """All of them."""
    path = contexts_file()
    try:
        document: Any = json.loads(path.read_text())
        gateways = {str(name): str(url) for name, url in document["contexts"].items()}
        return Contexts(str(document["current"]), gateways)
    except FileNotFoundError:
        return Contexts()
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ConfigError(f"{path} is damaged\ndelete it, and add the contexts again") from error


@contextmanager
def change() -> Iterator[Contexts]:
    """All of them, written in one step when the block ends well."""
    path = contexts_file()
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with file_lock(path.with_name("contexts.lock")):
            found = read()
            yield found
            draft.write_text(json.dumps({"current": found.current, "contexts": found.gateways}, indent=2) + "\n")
            draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from error
