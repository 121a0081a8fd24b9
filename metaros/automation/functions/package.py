"""A function's code as a zip file: looked through before it is kept, and unpacked where workers read it.

Blocking: for a thread, not for the event loop.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import io
import mmap
import os
import re
import shutil
import stat
import sys
import uuid
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from metaros.errors import PackageError
from metaros.limits import LIMITS, Limits

__all__ = ["PackageFacts", "check_zip", "discard", "unpack"]

ZipSource = io.BytesIO | io.BufferedReader
PIECE = 256 * 1024
MEMBER_SIGNATURE = b"PK\x01\x02"
ENCRYPTED = 0x1 | 0x40 | 0x2000
METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
PART_BYTES = 255  # of a file's name on every file system
UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff]")
DRIVE = re.compile(r"[A-Za-z]:")
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, UnicodeDecodeError, ValueError, OSError)


@dataclass(frozen=True, slots=True, kw_only=True)
class PackageFacts:
    """What a zip file is and holds; `names` are of files, folders left out."""

    sha256: str
    size_bytes: int
    unpacked_bytes: int
    names: tuple[str, ...]

    @property
    def code_sha256(self) -> str:
        """The digest as AWS writes it, in base 64."""
        return base64.b64encode(bytes.fromhex(self.sha256)).decode()

    @property
    def files(self) -> int:
        """How many files it holds."""
        return len(self.names)


def check_zip(source: Path | bytes, *, limits: Limits = LIMITS) -> PackageFacts:
    """Look a zip file through without unpacking it. PackageError names the member and the limit."""
    size = len(source) if isinstance(source, bytes) else source.stat().st_size
    if size > limits.function_zip_bytes:
        raise PackageError(f"the zip file has {size} bytes, at most {limits.function_zip_bytes}")
    with _reading(source) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        members = _members(file, limits)
    return PackageFacts(
        sha256=digest,
        size_bytes=size,
        unpacked_bytes=sum(member.file_size for member in members),
        names=tuple(member.filename for member in members if not member.is_dir()),
    )


def unpack(zip_path: Path, folder: Path, *, limits: Limits = LIMITS) -> Path:
    """Unpack into `folder/<sha256>`, all at once or not at all; one that is there already is taken as it is.

    Everyone may read the files, nobody may write them: workers are other users than the gateway.
    """
    facts = check_zip(zip_path, limits=limits)
    target = folder / facts.sha256
    if target.is_dir():
        return target
    folder.mkdir(parents=True, exist_ok=True)
    made = folder / f".{facts.sha256}.{uuid.uuid4().hex}"
    try:
        made.mkdir()
        _extract(zip_path, made, limits)
        if sys.platform != "win32":
            os.sync()  # a folder of that name is believed for ever: it is whole, also after a power cut
        with contextlib.suppress(FileExistsError, PermissionError):
            _rename(made, target)
    finally:
        if made.exists():
            discard(made)
    return target


def discard(folder: Path) -> None:
    """Delete an unpacked folder, which is read-only all through."""
    for where, folders, names in os.walk(folder):
        os.chmod(where, 0o755)
        for name in (*folders, *(names if sys.platform == "win32" else ())):
            os.chmod(os.path.join(where, name), 0o755)
    shutil.rmtree(folder)


def _rename(made: Path, target: Path) -> None:
    """Unless another was faster: then its folder is the same."""
    try:
        made.rename(target)
    except OSError:
        if not target.is_dir():
            raise
    else:
        target.chmod(0o555)


@contextmanager
def _reading(source: Path | bytes) -> Iterator[ZipSource]:
    with io.BytesIO(source) if isinstance(source, bytes) else source.open("rb") as file:
        yield file


def _members(file: ZipSource, limits: Limits) -> list[zipfile.ZipInfo]:
    """The members, each of them and all together within the limits."""
    _bound_count(file, limits)
    try:
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
    except DAMAGED as error:
        raise PackageError(f"no zip file, or a damaged one: {error}") from None
    if not any(not member.is_dir() for member in members):
        raise PackageError("the zip file is empty")
    unpacked = sum(member.file_size for member in members)
    if unpacked > limits.function_unpacked_bytes:
        raise PackageError(f"unpacked it has {unpacked} bytes, at most {limits.function_unpacked_bytes}")
    for member in members:
        _check_member(member, limits)
    _check_places(members)
    return members


def _bound_count(file: ZipSource, limits: Limits) -> None:
    """Count the members before `zipfile` makes an object of each: a small file can name a million."""
    file.seek(0)
    data: bytes | mmap.mmap
    with contextlib.ExitStack() as closing:
        if isinstance(file, io.BytesIO):
            data = file.getvalue()
        else:
            try:
                data = closing.enter_context(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
            except ValueError:
                raise PackageError("the zip file is empty") from None
        at, count = data.find(MEMBER_SIGNATURE), 0
        while at >= 0 and count <= limits.function_files:
            at, count = data.find(MEMBER_SIGNATURE, at + 4), count + 1
    if count > limits.function_files:
        raise PackageError(f"more than {limits.function_files} files and folders in the zip file")
    file.seek(0)


def _check_member(member: zipfile.ZipInfo, limits: Limits) -> None:
    name = member.orig_filename
    shown = ascii(name[:200])
    if len(name) > limits.function_path_chars:
        raise PackageError(f"{shown}…: a name of {len(name)} characters, at most {limits.function_path_chars}")
    if UNPRINTABLE.search(name):
        raise PackageError(f"{shown}: control characters in a name")
    parts = name.removesuffix("/").split("/")
    if "\\" in name or name.startswith("/") or DRIVE.match(name) or {"", ".", ".."} & set(parts):
        raise PackageError(f"{shown}: a name must be a relative path with `/`, and lead nowhere else")
    if any(len(part.encode()) > PART_BYTES for part in parts):
        raise PackageError(f"{shown}: a part of the name is longer than {PART_BYTES} bytes")
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        raise PackageError(f"{shown}: links and devices are not taken, only files and folders")
    if member.flag_bits & ENCRYPTED:
        raise PackageError(f"{shown} is encrypted")
    if member.compress_type not in METHODS:
        raise PackageError(f"{shown}: packed by method {member.compress_type}; only stored and deflated are taken")


def _check_places(members: list[zipfile.ZipInfo]) -> None:
    """No name twice, and none both a file and a folder."""
    files: set[str] = set()
    folders: set[str] = set()
    for member in members:
        path = member.filename.removesuffix("/")
        if path in files or (member.is_dir() and member.filename in folders):
            raise PackageError(f"{path!a}: twice in the zip file")
        if member.is_dir():
            folders.add(member.filename)
        else:
            files.add(path)
    above = {"/".join(path.split("/")[:depth]) for path in files for depth in range(1, path.count("/") + 1)}
    above |= {folder.removesuffix("/") for folder in folders}
    if both := files & above:
        raise PackageError(f"{min(both)!a}: a file and a folder in the zip file")


def _extract(zip_path: Path, into: Path, limits: Limits) -> None:
    left = limits.function_unpacked_bytes
    with zip_path.open("rb") as file:
        members = _members(file, limits)
        with zipfile.ZipFile(file) as archive:
            for member in members:
                place = into / member.filename
                if member.is_dir():
                    place.mkdir(parents=True, exist_ok=True)
                    continue
                place.parent.mkdir(parents=True, exist_ok=True)
                left -= _write_file(archive, member, place, left)
                runnable = member.external_attr >> 16 & 0o111
                place.chmod(0o555 if runnable else 0o444)
    for where, folders, _ in os.walk(into):
        for name in folders:
            os.chmod(os.path.join(where, name), 0o555)


def _write_file(archive: zipfile.ZipFile, member: zipfile.ZipInfo, place: Path, left: int) -> int:
    """Its real size, which may not be what the zip file says of it."""
    written = 0
    try:
        with archive.open(member) as packed, place.open("xb") as file:
            while piece := packed.read(PIECE):
                written += len(piece)
                if written > min(left, member.file_size):
                    raise PackageError(f"{member.filename!a}: more than the zip file says of it")
                file.write(piece)
    except FileExistsError:
        raise PackageError(f"{member.filename!a}: twice on a disk that knows no capitals") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise PackageError(f"{member.filename!a} is damaged: {error}") from None
    if written != member.file_size:
        raise PackageError(f"{member.filename!a}: {written} bytes, not {member.file_size}")
    return written
