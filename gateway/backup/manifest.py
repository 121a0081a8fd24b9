"""A backup's manifest: a small JSON file, written last, and a list of checksums that `sha256sum -c` reads.

A backup is a folder: `gateway.sqlite`, `objects/…`, perhaps `master.key`, `SHA256SUMS` and `manifest.json`. A folder
without the last one is none.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import orjson

from gateway.errors import CorruptObjectError, DamagedError
from metaros.errors import ConfigError

__all__ = [
    "FORMAT",
    "MANIFEST",
    "OBJECTS",
    "SUMS",
    "Manifest",
    "Part",
    "key_mark",
    "moment",
    "read_manifest",
    "read_sums",
    "sum_of",
    "write_line",
]

FORMAT = 1
MANIFEST, SUMS, OBJECTS = "manifest.json", "SHA256SUMS", "objects"
MANIFEST_BYTES = 64 << 20
PIECE_BYTES = 1 << 20


class Part(NamedTuple):
    """A file of a backup: its SHA-256 in hexadecimal, and its name below the folder, with `/`."""

    sha256: str
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Of which store a backup is, of what moment, and what must be in it. `taken_ns`: just before that moment.

    `sums`: the SHA-256 of SHA256SUMS. `schema`: how many migrations the store had. `damaged`: objects that were missing
    or damaged in the store itself when it was copied. `master_key`: which key sealed its secrets, "" where none has;
    `with_master_key`: whether that is in the backup.
    """

    store_id: str
    taken_ns: int
    database: str
    schema: int
    version: str
    objects: int
    size_bytes: int
    sums: str
    master_key: str = ""
    with_master_key: bool = False
    damaged: list[str] = field(default_factory=list)
    format: int = FORMAT

    def text(self) -> bytes:
        """The file, which ends with its own checksum."""
        said = asdict(self)
        return orjson.dumps({**said, "sha256": _sum_of(said)}, option=orjson.OPT_INDENT_2) + b"\n"


def read_manifest(folder: Path) -> Manifest:
    """What a backup says of itself.

    Raises:
        ConfigError: the folder holds no whole backup, or one of a newer program.
        CorruptObjectError: the file is damaged.
    """
    path = folder / MANIFEST
    try:
        if path.stat().st_size > MANIFEST_BYTES:
            raise CorruptObjectError(f"{path} is too large for a manifest")
        said = orjson.loads(path.read_bytes())
        if not isinstance(said, dict) or not isinstance(said.get("format"), int):
            raise CorruptObjectError(f"{path} is no manifest")
        if said["format"] > FORMAT:
            raise ConfigError(f"{folder} is a backup of format {said['format']}; this program knows {FORMAT}")
        if said.pop("sha256", "") != _sum_of(said):
            raise CorruptObjectError(f"{path} is damaged: its checksum is another one")
        return Manifest(**said)
    except FileNotFoundError as error:
        raise ConfigError(f"{folder} holds no whole backup: there is no {MANIFEST} in it") from error
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror or error}") from error
    except (orjson.JSONDecodeError, TypeError) as error:
        raise CorruptObjectError(f"{path} is damaged: {error}") from error


def write_line(part: Part) -> str:
    """A line of SHA256SUMS."""
    return f"{part.sha256}  {part.name}\n"


def read_sums(folder: Path) -> Iterator[Part]:
    """The files of a backup; DamagedError for a line that is none, or names a file elsewhere."""
    with (folder / SUMS).open(encoding="utf-8") as file:
        for line in file:
            sha256, _, name = line.rstrip("\n").partition("  ")
            if len(sha256) != 64 or not name or name.startswith("/") or ".." in name.split("/"):
                raise DamagedError(f"{folder / SUMS} is damaged: {line[:80]!r}")
            yield Part(sha256, name)


def sum_of(path: Path) -> tuple[str, int]:
    """A file's SHA-256 in hexadecimal, and its size in bytes; read in pieces."""
    digest, size_bytes = hashlib.sha256(), 0
    with path.open("rb") as file:
        while piece := file.read(PIECE_BYTES):
            digest.update(piece)
            size_bytes += len(piece)
    return digest.hexdigest(), size_bytes


def key_mark(key: bytes) -> str:
    """By what a master key is known again; nothing of it can be learned from that."""
    return hashlib.sha256(b"metaros master key\0" + key).hexdigest()[:16]


def moment(time_ns: int) -> str:
    """A time for people, to the second."""
    return datetime.fromtimestamp(time_ns / 1e9, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _sum_of(said: dict[str, Any]) -> str:
    return hashlib.sha256(orjson.dumps(said)).hexdigest()
