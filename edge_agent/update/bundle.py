"""A fetched bundle into a folder: member by member, each read back from the disk and compared with what was signed.

The bundle lay on the disk since it was checked, so its own hash is taken again first. Names and sizes are judged by
`metaros.fleet.bundle` before anything is written; nothing is extracted that it does not know.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
import zipfile
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from tuf.api.exceptions import LengthOrHashMismatchError

from edge_agent.update.errors import SlotError, UpdateForeignError, UpdateMetadataError, UpdateMismatchError
from edge_agent.update.repository import Fetched
from metaros.fleet.bundle import BundleError, Manifest, read_bundle
from metaros.limits import LIMITS

__all__ = ["check_target", "unpack"]

PIECE_BYTES = 1 << 20
_OPERATORS = {">=": lambda a, b: a >= b, "<": lambda a, b: a < b, "==": lambda a, b: a == b}


def check_target(manifest: Manifest, *, kind: str, name: str, version: str) -> None:
    """That the bundle is the one that was asked for, and for this machine. Raises UpdateForeignError."""
    if (manifest.kind, manifest.name, manifest.version) != (kind, name, version):
        said = f"{manifest.kind} {manifest.name} {manifest.version}"
        raise UpdateForeignError(f"the bundle of {kind} {name} {version} says that it is {said}")
    machine = platform.machine().lower()
    if manifest.hw and machine not in {word.lower() for word in manifest.hw}:
        raise UpdateForeignError(f"{name} {version} is for {', '.join(manifest.hw)}; this robot is {machine}")
    ours = sys.version_info[:2]
    for term in filter(None, manifest.python.split(",")):
        operator = term[:2] if term[:2] in _OPERATORS else term[:1]
        major, minor = term[len(operator) :].split(".")
        if not _OPERATORS[operator](ours, (int(major), int(minor))):
            raise UpdateForeignError(
                f"{name} {version} needs Python {manifest.python}; this robot has {ours[0]}.{ours[1]}"
            )


def unpack(fetched: Fetched, folder: Path) -> Manifest:
    """Everything of the bundle in an empty folder.

    Raises:
        UpdateMismatchError: the bundle is not, or no longer, what was signed; the disk gave other bytes than it took.
        UpdateMetadataError: it is signed, and yet no bundle.
        UpdateForeignError: it is not what its signed description says.
        SlotError: the disk refuses.
    """
    try:
        with fetched.path.open("rb") as file:
            fetched.target.verify_length_and_hashes(file)
            file.seek(0)
            manifest = read_bundle(file)
            if fetched.custom and dict(fetched.custom) != manifest.custom:
                raise UpdateForeignError(f"{manifest.name} {manifest.version} is not what was signed of it")
            file.seek(0)
            with zipfile.ZipFile(file) as archive:
                for member in archive.infolist():
                    if not member.is_dir():
                        _unpack_member(archive, member, folder)
    except LengthOrHashMismatchError as error:
        raise UpdateMismatchError(f"the bundle on the disk is not the one that was signed: {error}") from error
    except BundleError as error:
        raise UpdateMetadataError(str(error)) from error
    except zipfile.BadZipFile as error:
        raise UpdateMismatchError(str(error)) from error
    except OSError as error:
        raise SlotError(f"cannot unpack the bundle: {error.strerror or error}") from error
    return manifest


def _unpack_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path) -> None:
    """One member, synced and read back."""
    place = folder.joinpath(*PurePosixPath(member.filename).parts)
    if not place.resolve().is_relative_to(folder.resolve()) or member.file_size > LIMITS.update_bytes:
        raise UpdateMismatchError(f"{member.filename[:80]!r} is not unpacked")  # read_bundle lets none of them through
    place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    mode = 0o700 if (member.external_attr >> 16) & 0o100 else 0o600
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
    digest, left = hashlib.sha256(), member.file_size
    with archive.open(member) as source, os.fdopen(os.open(place, flags, mode), "wb") as target:
        while piece := source.read(min(PIECE_BYTES, left + 1)):
            left -= len(piece)
            if left < 0:
                raise UpdateMismatchError(f"{member.filename[:80]!r} has more bytes than it says")
            digest.update(piece)
            target.write(piece)
        target.flush()
        os.fsync(target.fileno())
    with place.open("rb") as back:
        if left or _hash(back) != digest.digest():
            raise UpdateMismatchError(f"the disk gives {member.filename[:80]!r} back otherwise than it took it")


def _hash(file: BinaryIO) -> bytes:
    digest = hashlib.sha256()
    while piece := file.read(PIECE_BYTES):
        digest.update(piece)
    return digest.digest()
