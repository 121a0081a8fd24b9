"""A function's code made ready to go: a folder, one Python file or a zip file becomes bytes, the same ones each time.

Names in a folder are sorted and times left out, so what did not change has the digest that it had. Left out is what
`.gitignore` and `.metarosignore` at the folder's top say, and what never belongs to code (caches, virtual environments,
`.env`).
"""

from __future__ import annotations

import fnmatch
import io
import os
import re
import stat
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from metaros.errors import UsageError
from metaros.limits import LIMITS

__all__ = ["Packed", "pack"]

NEVER = (
    *(".git/", ".hg/", ".venv/", "venv/", "node_modules/", "__pycache__/", ".mypy_cache/", ".pytest_cache/"),
    *(".ruff_cache/", ".gitignore", ".metarosignore", ".env", "*.pyc", ".DS_Store"),
)
IGNORES = (".gitignore", ".metarosignore")
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first that zip files know
MIB = 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """Code as a zip file; `modules` are the names of Python files at its top, without `.py`."""

    data: bytes
    files: int
    left_out: int
    modules: tuple[str, ...]


def pack(source: Path) -> Packed:
    """UsageError says what cannot be packed, and why."""
    if source.is_dir():
        return _folder(source)
    if not source.is_file():
        raise UsageError(f"there is no {source}\ngive a folder, a Python file or a zip file")
    if source.suffix == ".zip":
        return _zip(source)
    if source.suffix == ".py":
        return _packed({source.name: source}, left_out=0)
    raise UsageError(f"{source}: neither a folder, nor a Python file, nor a zip file")


def _zip(source: Path) -> Packed:
    _bound(source.stat().st_size, f"{source}: the zip file", LIMITS.function_zip_bytes)
    data = source.read_bytes()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if not name.endswith("/")]
    except zipfile.BadZipFile as error:
        raise UsageError(f"{source}: no zip file: {error}") from error
    return Packed(data=data, files=len(names), left_out=0, modules=_modules(names))


def _folder(source: Path) -> Packed:
    rules = [_Rule.parse(line) for line in NEVER]
    for name in IGNORES:
        if (source / name).is_file():
            lines = (line.rstrip() for line in (source / name).read_text(encoding="utf-8").splitlines())
            rules += [_Rule.parse(line) for line in lines if line and not line.startswith("#")]
    found: dict[str, Path] = {}
    left_out = 0
    for path, kept in _walk(source, rules):
        if kept:
            found[path.relative_to(source).as_posix()] = _checked(path, source)
        else:
            left_out += 1
    if not found:
        raise UsageError(f"{source}: there is no file in it")
    return _packed(found, left_out=left_out)


def _walk(source: Path, rules: list[_Rule]) -> Iterator[tuple[Path, bool]]:
    """Every file, and whether it is kept; a folder that is left out counts once."""
    for at, folders, files in os.walk(source):
        here = Path(at)
        for name in sorted(folders):
            if _left_out(here / name, source, rules, folder=True):
                folders.remove(name)
                yield here / name, False
            elif (here / name).is_symlink():
                raise UsageError(f"{here / name}: a link to a folder cannot be packed")
        folders.sort()
        for name in sorted(files):
            yield here / name, not _left_out(here / name, source, rules, folder=False)


def _checked(path: Path, source: Path) -> Path:
    """A file to pack; a link leads to one within the folder."""
    if not path.is_file() or not path.resolve().is_relative_to(source.resolve()):
        raise UsageError(f"{path}: no file within {source}")
    return path


def _packed(files: dict[str, Path], *, left_out: int) -> Packed:
    if len(files) > LIMITS.function_files:
        raise UsageError(f"{len(files)} files; code has at most {LIMITS.function_files}")
    total = sum(path.stat().st_size for path in files.values())
    _bound(total, "the code, unpacked,", LIMITS.function_unpacked_bytes)
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            runs = files[name].stat().st_mode & stat.S_IXUSR
            entry.external_attr = (stat.S_IFREG | (0o755 if runs else 0o644)) << 16
            entry.create_system = 3  # Unix, wherever it is made
            archive.writestr(entry, files[name].read_bytes())
    data = target.getvalue()
    _bound(len(data), "the zip file", LIMITS.function_zip_bytes)
    return Packed(data=data, files=len(files), left_out=left_out, modules=_modules(files))


def _bound(size: int, what: str, most: int) -> None:
    if size > most:
        raise UsageError(f"{what} has {size / MIB:.1f} MiB, at most {most // MIB} MiB")


def _modules(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(name.removesuffix(".py") for name in names if name.endswith(".py") and "/" not in name))


def _left_out(path: Path, source: Path, rules: list[_Rule], *, folder: bool) -> bool:
    """The last rule that fits says so, as in Git."""
    name, out = path.relative_to(source).as_posix(), False
    for rule in rules:
        if rule.fits(name, folder=folder):
            out = not rule.kept
    return out


@dataclass(frozen=True, slots=True)
class _Rule:
    """A line of `.gitignore`."""

    pattern: re.Pattern[str]
    folders_only: bool
    kept: bool

    @classmethod
    def parse(cls, line: str) -> _Rule:
        kept, folders_only = line.startswith("!"), line.endswith("/")
        text = line.removeprefix("!").rstrip("/")
        if "/" not in text:
            text = f"**/{text}"  # wherever it is
        parts = [".*" if part == "**" else _part(part) for part in text.lstrip("/").split("/")]
        return cls(re.compile("/".join(parts).replace(".*/", "(?:.*/)?")), folders_only, kept)

    def fits(self, name: str, *, folder: bool) -> bool:
        return (folder or not self.folders_only) and self.pattern.fullmatch(name) is not None


def _part(text: str) -> str:
    """One name of a path: a `*` in it does not reach over `/`."""
    found = fnmatch.translate(text).removeprefix("(?s:").removesuffix(r")\Z").removesuffix(r")\z")
    return found.replace(".*", "[^/]*")
