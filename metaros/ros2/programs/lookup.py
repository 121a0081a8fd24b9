"""Find what is to run: a file, a module, or a package's executable, as `ros2 run PACKAGE EXECUTABLE` finds it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any, Final

from metaros.errors import ConfigError
from metaros.ros2.programs.run import Program

__all__ = ["Executable", "executables", "find_program"]

_UP: Final = 5  # folders above a file in which the package.xml of its package is looked for

# Executables of ROS 2's own packages that launch files count on, for where that package is not installed.
OWN: Final = {
    ("tf2_ros", "static_transform_publisher"): "metaros.ros2.tf2_ros.static_transform_publisher:main",
}


@dataclass(frozen=True, slots=True, order=True)
class Executable:
    """What `PACKAGE EXECUTABLE` names, and where it was found."""

    package: str
    name: str
    where: str


def find_program(
    words: Sequence[str],
    *,
    package_path: Sequence[Path] = (),
    environ: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> tuple[Program, list[str]]:
    """The program that the first one or two words name, and the rest of them, which are its arguments.

    A file; else a package and its executable: of the folders `package_path`, of `AMENT_PREFIX_PATH`, of an installed
    distribution, of an unbuilt package at or beneath the current folder; else a module. ConfigError where there is
    none. `folder` stands in for the current one.
    """
    if not words:
        raise ConfigError("what shall run? a FILE, a MODULE, or a PACKAGE and its EXECUTABLE")
    first, rest = words[0], list(words[1:])
    folder = Path.cwd() if folder is None else folder
    if _looks_like_a_file(first, folder):
        path = Path(first) if folder == Path.cwd() else folder / first
        if not path.exists():
            raise ConfigError(f"there is no file {first}")
        return Program(argv0=first, file=path, path=tuple(_folders_of(path.resolve()))), rest
    environ = os.environ if environ is None else environ
    if rest and not rest[0].startswith("-"):
        program = _of_package(first, rest[0], package_path, environ, folder)
        if program is not None:
            return program, rest[1:]
    folders = (*map(str, package_path), str(folder))
    if _is_module(first, folders):
        return Program(argv0=first, module=first, path=folders), rest
    raise ConfigError(_nothing_found(first, rest, (*package_path, folder), environ))


def executables(
    *, package_path: Sequence[Path] = (Path(),), environ: Mapping[str, str] | None = None
) -> Iterator[Executable]:
    """All that `PACKAGE EXECUTABLE` can name; of installed distributions those alone that are ROS 2 packages."""
    from metaros.ros2.programs.source_packages import source_packages

    environ = os.environ if environ is None else environ
    for folder in package_path:
        for package in source_packages(folder):
            points = package.entry_points()
            scripts = {path.name: path for path in package.scripts().values()} if not points else {}
            for name in {**points, **scripts}:
                yield Executable(package.name, name, str(package.folder))
    for prefix in _prefixes(environ):
        for path in sorted((prefix / "lib").glob("*/*")) if prefix.is_dir() else ():
            if path.is_file() and os.access(path, os.X_OK) and (prefix / "share" / path.parent.name).is_dir():
                yield Executable(path.parent.name, path.name, str(prefix))
    yield from _of_distributions()
    for package_name, name in OWN:
        yield Executable(package_name, name, "metaros")


def _of_distributions() -> Iterator[Executable]:
    from importlib.metadata import distributions

    for found in distributions():
        name = str(found.metadata["Name"]).replace("-", "_")
        points = found.entry_points.select(group="console_scripts")
        if points and f"share/{name}/package.xml" in (found.read_text("RECORD") or ""):
            for point in points:
                yield Executable(name, point.name, f"{name} {found.version}")


def _looks_like_a_file(word: str, folder: Path) -> bool:
    """By its ending or a slash; a word alone may be the name of a package."""
    return word.endswith((".py", ".pyc", ".pyz")) or os.sep in word or ((folder / word).is_file() and "-" in word)


def _folders_of(path: Path) -> Iterator[str]:
    """Where a file's modules are: beside it, and in the package in source that it is of."""
    yield str(path.parent)
    for folder in path.parents[:_UP]:
        if (folder / "package.xml").is_file():
            if folder != path.parent:
                yield str(folder)
            return


def _of_package(
    package: str, name: str, package_path: Sequence[Path], environ: Mapping[str, str], folder: Path
) -> Program | None:
    return (
        _of_sources(package, name, package_path)
        or _of_prefixes(package, name, environ)
        or _of_distribution(package, name)
        or _own(package, name)
        or _of_sources(package, name, (folder,))
    )


def _own(package: str, name: str) -> Program | None:
    function = OWN.get((package, name))
    return None if function is None else Program(argv0=name, function=function)


def _of_sources(package: str, name: str, roots: Sequence[Path]) -> Program | None:
    from metaros.ros2.programs.source_packages import source_packages  # which only packages need

    for root in roots:
        for found in source_packages(root.resolve()):
            if found.name != package:
                continue
            function = found.entry_points().get(name)
            if function is not None:
                return Program(argv0=name, function=function, path=(str(found.folder),))
            script = found.scripts().get(name)
            if script is not None:
                return Program(argv0=str(script), file=script, path=(str(script.parent), str(found.folder)))
    return None


def _of_prefixes(package: str, name: str, environ: Mapping[str, str]) -> Program | None:
    from metaros.ros2.programs.source_packages import is_python

    for prefix in _prefixes(environ):
        path = prefix / "lib" / package / name
        if not path.is_file():
            continue
        if is_python(path):
            return Program(argv0=str(path), file=path, path=(str(path.parent), *_site_packages(prefix)))
        return Program(argv0=str(path), binary=path)
    return None


def _prefixes(environ: Mapping[str, str]) -> list[Path]:
    return [Path(part) for part in environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]


def _site_packages(prefix: Path) -> list[str]:
    """Where the prefix keeps Python modules: if they were installed for another Python, most of them run in ours."""
    found = [*prefix.glob("lib/python3*/site-packages"), *prefix.glob("local/lib/python3*/dist-packages")]
    own = f"python{sys.version_info.major}.{sys.version_info.minor}"
    return sorted(map(str, found), key=lambda part: own not in part)


def _of_distribution(package: str, name: str) -> Program | None:
    """A console script of a distribution of that name, or of one that has a package of that name."""
    from importlib.metadata import entry_points

    for point in entry_points(group="console_scripts", name=name):
        distribution: Any = point.dist
        called = "" if distribution is None else str(distribution.metadata["Name"]).replace("-", "_").lower()
        if package.replace("-", "_").lower() == called or point.module.partition(".")[0] == package:
            return Program(argv0=name, function=f"{point.module}:{point.attr}")
    return None


def _is_module(name: str, folders: Sequence[str]) -> bool:
    """Whether Python would find it; packages are searched, not run."""
    path: Any = [*folders, *sys.path]
    parts = name.split(".")
    if not all(part.isidentifier() for part in parts):
        return False
    for number, part in enumerate(parts, 1):
        spec = PathFinder.find_spec(part, path)
        if spec is None:
            return False
        path = spec.submodule_search_locations or []
        if number == len(parts) and spec.submodule_search_locations is not None:
            return PathFinder.find_spec("__main__", path) is not None
    return True


def _nothing_found(first: str, rest: Sequence[str], package_path: Sequence[Path], environ: Mapping[str, str]) -> str:
    import difflib

    found = list(executables(package_path=package_path, environ=environ))
    names = sorted({row.name for row in found if row.package == first})
    if names:
        wanted = rest[0] if rest else ""
        near = difflib.get_close_matches(wanted, names, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are: {', '.join(names)}"
        return f"package {first} has no executable {wanted!r}; {hint}" if wanted else f"{first} is a package; {hint}"
    near = difflib.get_close_matches(first, {row.package for row in found}, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    return (
        f"{first!r} is no file, no module, and no package with executables here{hint}\n"
        "looked at AMENT_PREFIX_PATH, installed distributions, and package.xml beneath "
        f"{' '.join(str(folder) for folder in package_path)}"
    )
