"""Bundles: the signed zip files that hold a node or the agent, checked within bounds before anything of them is used.

A bundle has `bundle.toml` at its root, wheels under `wheels/` and, for nodes that are no Python, further files under
`files/`. The gateway checks one when it is uploaded, the people's machine before it signs one, and the robot before it
unpacks one: all by this module. A version is two to four numbers with dots between, compared as numbers.
"""

from __future__ import annotations

import contextlib
import io
import re
import stat
import tomllib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, Literal

from metaros.errors import MetarosError

__all__ = [
    "AGENT",
    "BundleError",
    "Manifest",
    "check_group",
    "parse_manifest",
    "read_bundle",
    "target_path",
    "version_key",
]

AGENT = "metaros"  # the name of the agent's own bundles
OWN = "metaros."  # an entry that begins so is in the robot's own install: it needs no wheel
MEMBERS = 512
UNPACKED_BYTES = 1 << 30
RATIO = 200  # what a member may grow by; wheels are packed already
MANIFEST_BYTES = 64 * 1024
READ_BYTES = 1 << 20  # of a bundle at a time: its directory of members, too
NAME_CHARS = 255
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?")
_VERSION = re.compile(r"(?:0|[1-9]\d{0,8})(?:\.(?:0|[1-9]\d{0,8})){1,3}")
_PYTHON = re.compile(r"(?:(?:>=|<|==)3\.\d{1,3})(?:,(?:>=|<|==)3\.\d{1,3})*")
_ENTRY = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")
_HW = re.compile(r"[A-Za-z0-9_.-]{1,64}")
_IMAGE = re.compile(r"files/(?:[A-Za-z0-9_.+@-]+/)*[A-Za-z0-9_.+@-]+\.tar")
_MEMBER = re.compile(r"(?:bundle\.toml|wheels/[A-Za-z0-9_.+!-]+\.whl|files/(?:[A-Za-z0-9_.+@-]+/)*[A-Za-z0-9_.+@-]+)")
_KEYS = {"format", "name", "kind", "version", "min_version", "hw", "python", "entry", "command", "image"}


class BundleError(MetarosError):
    """What should be a bundle is none; the message names what is wrong with it, and the limit."""

    code: ClassVar[str] = "bundle_invalid"


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What a bundle says of itself: `bundle.toml`."""

    name: str
    kind: Literal["node", "agent"]
    version: str
    min_version: str = ""  # once it runs well, nothing older than this is ever installed again
    hw: tuple[str, ...] = ()  # machines it is for, as platform.machine() names them; none: every one
    python: str = ""
    entry: str = ""
    command: tuple[str, ...] = ()
    image: str = ""  # a container's, as a tar file of the bundle: what an engine has saved

    @property
    def path(self) -> str:
        """Its path among the update targets."""
        return target_path(self.kind, self.name, self.version)

    @property
    def custom(self) -> dict[str, Any]:
        """What is signed with the target beside length and hash."""
        return {
            "name": self.name,
            "kind": self.kind,
            "version": self.version,
            "min_version": self.min_version,
            "hw": list(self.hw),
            "python": self.python,
        }


def version_key(text: str) -> tuple[int, ...]:
    """A version to compare by; `1.2` is `1.2.0.0`. BundleError for what is none."""
    if not isinstance(text, str) or _VERSION.fullmatch(text) is None:
        raise BundleError(f"version {str(text)[:40]!r} is not two to four numbers like 1.2.0")
    numbers = tuple(int(part) for part in text.split("."))
    return numbers + (0,) * (4 - len(numbers))


def target_path(kind: str, name: str, version: str, *, group: str = "") -> str:
    """`nodes/lidar-node/1.2.0.zip`; with a group, the path that this group's delegated role signs."""
    version_key(version)
    if kind not in ("node", "agent") or _NAME.fullmatch(name) is None:
        raise BundleError(f"{kind[:20]} {name[:80]!r} is no kind and name of a bundle: node or agent, a-z, 0-9 and '-'")
    base = f"{kind}s/{name}/{version}.zip"
    return f"robots/{check_group(group)}/{base}" if group else base


def check_group(group: str) -> str:
    """The group's name; BundleError when it is none."""
    if _NAME.fullmatch(group) is None:
        raise BundleError(f"group {group[:80]!r}: a-z, 0-9 and '-', at most 63 characters")
    return group


def parse_manifest(document: Mapping[str, Any]) -> Manifest:
    """The table of `bundle.toml`, or a target's custom field; BundleError names what does not fit."""
    unknown = sorted(set(document) - _KEYS)
    if unknown:
        raise BundleError(f"bundle.toml: {unknown[0][:40]!r} is not known")
    if document.get("format", 1) != 1:
        raise BundleError("bundle.toml: format is not 1, which is all that is known here")
    texts = {key: _text(document, key) for key in sorted(_KEYS - {"format", "hw", "command"})}
    lists = {key: _texts(document, key) for key in ("hw", "command")}
    kind = texts["kind"]
    if kind not in ("node", "agent"):
        raise BundleError(f"bundle.toml: kind is node or agent, not {kind[:20]!r}")
    target_path(kind, texts["name"], texts["version"])
    if (kind == "agent") != (texts["name"] == AGENT):
        raise BundleError(f"bundle.toml: the agent's bundles, and no others, have the name {AGENT}")
    if texts["min_version"] and version_key(texts["min_version"]) > version_key(texts["version"]):
        raise BundleError("bundle.toml: min_version is above version: the bundle would forbid itself")
    for key, pattern in (("python", _PYTHON), ("entry", _ENTRY), ("image", _IMAGE)):
        if texts[key] and pattern.fullmatch(texts[key]) is None:
            raise BundleError(f"bundle.toml: {key} {texts[key][:60]!r} does not fit")
    if any(_HW.fullmatch(word) is None for word in lists["hw"]):
        raise BundleError("bundle.toml: hw has words like aarch64")
    known: Literal["node", "agent"] = "agent" if kind == "agent" else "node"
    return Manifest(
        name=texts["name"],
        kind=known,
        version=texts["version"],
        min_version=texts["min_version"],
        hw=lists["hw"],
        python=texts["python"],
        entry=texts["entry"],
        command=lists["command"],
        image=texts["image"],
    )


def read_bundle(source: Path | BinaryIO) -> Manifest:
    """What a bundle says of itself, once all of it was found within its bounds; nothing is unpacked to the disk.

    Raises:
        BundleError: it is no bundle.
    """
    try:
        with contextlib.ExitStack() as stack:
            file = stack.enter_context(source.open("rb")) if isinstance(source, Path) else source
            archive = stack.enter_context(zipfile.ZipFile(_Bounded(file)))
            members = archive.infolist()
            _check_members(members)
            manifest = _manifest(archive)
            _check_content(manifest, {member.filename for member in members})
            bad = archive.testzip()  # reads every member, each bounded by the size it claims
    except (zipfile.BadZipFile, zipfile.LargeZipFile, NotImplementedError, EOFError, RuntimeError, OSError) as error:
        raise BundleError(f"no bundle: {error}") from error
    except ValueError as error:
        raise BundleError(f"no bundle: {str(error)[:200]}") from error
    except Exception as error:  # zlib.error, lzma.LZMAError: bytes that are no stream
        if isinstance(error, MetarosError):
            raise
        raise BundleError(f"no bundle: {str(error)[:200]}") from error
    if bad is not None:
        raise BundleError(f"no bundle: the checksum of {bad[:80]!r} does not hold")
    return manifest


class _Bounded(io.RawIOBase):
    """A file of which nobody reads much at a time: zipfile would take in a directory of millions of members first, and
    ask how many there are afterwards."""

    def __init__(self, file: BinaryIO) -> None:
        super().__init__()
        self._file = file

    def read(self, size: int = -1, /) -> bytes:
        """Up to `size` bytes; BundleError for more than READ_BYTES."""
        if size < 0:
            place = self._file.tell()
            size = self._file.seek(0, io.SEEK_END) - place
            self._file.seek(place)
        if size > READ_BYTES:
            raise BundleError(f"no bundle: its directory has more than {READ_BYTES} bytes")
        return self._file.read(size)

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """As of the file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As of the file."""
        return self._file.tell()

    def seekable(self) -> bool:
        """It is a file."""
        return True


def _check_members(members: list[zipfile.ZipInfo]) -> None:
    if not 1 <= len(members) <= MEMBERS:
        raise BundleError(f"a bundle has 1 to {MEMBERS} members, not {len(members)}")
    names: set[str] = set()
    total = 0
    for member in members:
        name = member.filename
        if member.is_dir() and re.fullmatch(r"(?:[A-Za-z0-9_.+@-]+/)+", name) and ".." not in name.split("/"):
            continue
        if len(name) > NAME_CHARS or _MEMBER.fullmatch(name) is None or {".", ".."} & set(name.split("/")):
            raise BundleError(f"a bundle has bundle.toml, wheels/*.whl and files/**, and not {name[:80]!r}")
        if name.lower() in names:
            raise BundleError(f"{name[:80]!r} is in it twice")
        names.add(name.lower())
        mode = member.external_attr >> 16
        if mode and not stat.S_ISREG(mode) and stat.S_IFMT(mode):
            raise BundleError(f"{name[:80]!r} is no regular file")
        if member.flag_bits & 1:
            raise BundleError(f"{name[:80]!r} is encrypted")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BundleError(f"{name[:80]!r} is packed otherwise than by deflate")
        total += member.file_size
        if member.file_size > RATIO * max(1, member.compress_size):
            raise BundleError(f"{name[:80]!r} grows more than {RATIO} times")
        if total > UNPACKED_BYTES:
            raise BundleError(f"unpacked it has more than {UNPACKED_BYTES} bytes")


def _manifest(archive: zipfile.ZipFile) -> Manifest:
    try:
        info = archive.getinfo("bundle.toml")
    except KeyError:
        raise BundleError("there is no bundle.toml in it") from None
    if info.file_size > MANIFEST_BYTES:
        raise BundleError(f"bundle.toml has more than {MANIFEST_BYTES} bytes")
    with archive.open(info) as file:
        text = file.read(MANIFEST_BYTES + 1)
    try:
        document = tomllib.loads(text.decode())
    except (ValueError, RecursionError) as error:
        raise BundleError(f"bundle.toml cannot be read: {str(error)[:200]}") from error
    if "format" not in document:
        raise BundleError("bundle.toml: format = 1 is missing")
    return parse_manifest(document)


def _check_content(manifest: Manifest, names: set[str]) -> None:
    wheels = any(name.startswith("wheels/") and name.endswith(".whl") for name in names)
    if manifest.kind == "agent":
        if manifest.entry or manifest.command or manifest.image or not wheels:
            raise BundleError("the agent's bundle has wheels, and neither entry nor command nor image")
        return
    if [bool(manifest.entry), bool(manifest.command), bool(manifest.image)].count(True) != 1:
        raise BundleError("bundle.toml: say one of entry, command and image")
    if manifest.image and manifest.image not in names:
        raise BundleError(f"bundle.toml: image: there is no {manifest.image[:80]!r} in the bundle")
    if manifest.entry and not wheels and not manifest.entry.startswith(OWN):
        raise BundleError("bundle.toml: an entry needs a wheel under wheels/")
    if manifest.command and manifest.command[0] not in names:
        raise BundleError(f"bundle.toml: command begins with {manifest.command[0][:80]!r}, which is not in the bundle")


def _text(document: Mapping[str, Any], key: str) -> str:
    found = document.get(key, "")
    if not isinstance(found, str) or len(found) > NAME_CHARS:
        raise BundleError(f"bundle.toml: {key} is a text of at most {NAME_CHARS} characters")
    return found


def _texts(document: Mapping[str, Any], key: str) -> tuple[str, ...]:
    found = document.get(key, [])
    if not isinstance(found, list) or len(found) > 64:
        raise BundleError(f"bundle.toml: {key} is a list of at most 64 texts")
    for item in found:
        if not isinstance(item, str) or not 0 < len(item) <= 4096 or "\0" in item:
            raise BundleError(f"bundle.toml: {key} is a list of texts")
    return tuple(found)
