"""ROS 2 parameter files: YAML with node names (wildcards allowed), each with its `ros__parameters`.

    /**:                      # every node
      ros__parameters:
        use_sim_time: false
    /sim_1/base:              # or /sim_1/*, /**/base, base
      ros__parameters:
        max_speed: 0.5
        motor: {gain: 1.0}    # motor.gain

What stands further down wins; a node name may stand there several times, which plain YAML would not have.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from metaros.errors import ConfigError, ParameterError
from metaros.node.parameters.values import infer

__all__ = ["dump_yaml", "load_file", "load_text", "parse_value", "read_sections"]

MARK: Final = "ros__parameters"
_DEPTH: Final = 32


class _Loader(yaml.SafeLoader):
    """YAML as ROS 2 reads it: 1e-3 is a number; dates, 1:30 and 0o-less octals are what they look like."""


_Loader.yaml_implicit_resolvers = {}
_PLAIN: Final = (
    (
        "tag:yaml.org,2002:bool",
        r"yes|Yes|YES|no|No|NO|true|True|TRUE|false|False|FALSE|on|On|ON|off|Off|OFF",
        "yYnNtTfFoO",
    ),
    ("tag:yaml.org,2002:null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("tag:yaml.org,2002:int", r"[-+]?(?:0x[0-9a-fA-F]+|0|[1-9][0-9]*)", "-+0123456789"),
    (
        "tag:yaml.org,2002:float",
        r"[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+|[0-9]+(?=[eE]))(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        "-+0123456789.",
    ),
    ("tag:yaml.org,2002:merge", r"<<", "<"),
)
for _tag, _pattern, _first in _PLAIN:
    _Loader.add_implicit_resolver(_tag, re.compile(rf"(?:{_pattern})\Z"), list(_first))


class _Sections(dict[Any, Any]):
    """A mapping that also has its items one by one, keys that come twice included."""

    def __init__(self) -> None:
        super().__init__()
        self.every: list[tuple[Any, Any]] = []


class _FileLoader(_Loader):
    """Mappings of files are `_Sections`."""

    def construct_sections(self, node: yaml.MappingNode) -> Iterator[_Sections]:
        """First empty, as PyYAML wants it, for what refers to itself."""
        found = _Sections()
        yield found
        found.update(self.construct_mapping(node))
        found.every = [(self.construct_object(key), self.construct_object(value)) for key, value in node.value]


_FileLoader.add_constructor("tag:yaml.org,2002:map", _FileLoader.construct_sections)


class _Dumper(yaml.SafeDumper):
    """Writes what `_Loader` reads back as the same value."""


_Dumper.yaml_implicit_resolvers = {
    key: [*yaml.SafeDumper.yaml_implicit_resolvers.get(key, []), *_Loader.yaml_implicit_resolvers.get(key, [])]
    for key in {*yaml.SafeDumper.yaml_implicit_resolvers, *_Loader.yaml_implicit_resolvers}
}
_Dumper.ignore_aliases = lambda *_: True  # type: ignore[method-assign]
_Dumper.add_representer(
    str,  # between single quotes PyYAML would fold what is no printable character
    lambda dumper, text: dumper.represent_scalar(
        "tag:yaml.org,2002:str", text, style=None if text.isprintable() else '"'
    ),
)


def parse_value(text: str) -> Any:
    """One value as ROS 2's YAML reads it; text that is no YAML stands for itself."""
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError:
        return text


def load_file(path: str | Path, node: str, *, wildcards: bool = True) -> dict[str, Any]:
    """What the file says of the node with this full name; ConfigError where it is no parameter file."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"parameter file {path}: {error}") from None
    return load_text(text, node, wildcards=wildcards, source=str(path))


def load_text(text: str, node: str, *, wildcards: bool = True, source: str = "parameters") -> dict[str, Any]:
    """The same for the text of such a file."""
    found: dict[str, Any] = {}
    for pattern, parameters in _parts(text, source):
        if pattern == node if not wildcards else _matches(pattern, node):
            found.update(_flat(parameters, "", source, 0))
    return found


def read_sections(text: str, source: str = "parameters") -> list[tuple[str, dict[str, Any]]]:
    """Every node name of the file, with a slash before it and wildcards in it, and the parameters that it is given."""
    return [(pattern, dict(_flat(parameters, "", source, 0))) for pattern, parameters in _parts(text, source)]


def _parts(text: str, source: str) -> Iterator[tuple[str, Mapping[Any, Any]]]:
    try:
        tree = yaml.load(text, _FileLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError(f"{source}: no YAML: {' '.join(str(error).split())}") from None
    return iter(()) if tree is None else _sections(tree, "", source, 0)


def _sections(tree: object, path: str, source: str, depth: int) -> Iterator[tuple[str, Mapping[Any, Any]]]:
    """Each node name of the file, namespaces joined, with its parameters."""
    if not isinstance(tree, _Sections) or depth > _DEPTH:
        raise ConfigError(f"{source}: {path or 'the file'} must hold node names, each with {MARK}:")
    for key, inner in tree.every:
        if key == MARK and path:
            if inner is not None and not isinstance(inner, Mapping):
                raise ConfigError(f"{source}: {path}: {MARK} must hold names and values")
            yield path, inner or _Sections()
            continue
        name = f"{path}/{str(key).strip('/')}" if str(key).strip("/") else path
        if not isinstance(inner, Mapping) or not inner:
            raise ConfigError(f"{source}: {name or key}: {MARK}: is missing")
        yield from _sections(inner, name, source, depth + 1)


def _matches(pattern: str, node: str) -> bool:
    """`*` stands for one part of a name, `**` for any number of them."""
    parts = [
        "(?:/[^/]+)*" if part == "**" else "/" + "[^/]*".join(map(re.escape, part.split("*")))
        for part in pattern.split("/")[1:]
    ]
    return re.fullmatch("".join(parts), node) is not None


def _flat(parameters: Mapping[Any, Any], prefix: str, source: str, depth: int) -> Iterator[tuple[str, Any]]:
    if depth > _DEPTH:
        raise ConfigError(f"{source}: {prefix[:40]}… is nested deeper than {_DEPTH}")
    for key, value in parameters.every if isinstance(parameters, _Sections) else parameters.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from _flat(value, f"{name}.", source, depth + 1)
        elif value is not None:
            try:
                yield name, infer(value)
            except ParameterError as error:
                raise ConfigError(f"{source}: {name}: {error}") from None


def dump_yaml(node: str, values: Mapping[str, Any]) -> str:
    """A parameter file that sets a node's parameters to these values; names with dots are nested."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        if value is not None:
            group, key = _place(tree, name, values)
            group[key] = value
    text: str = yaml.dump(
        {node: {MARK: tree}}, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )
    return text


def _place(tree: dict[str, Any], name: str, values: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """The group and the key of a name: nested by its dots, except below a name that is a parameter itself."""
    head, dot, rest = name.partition(".")
    path = head
    while dot and head and rest and path not in values:
        tree = tree.setdefault(head, {})
        name = rest
        head, dot, rest = name.partition(".")
        path += f".{head}"
    return tree, name
