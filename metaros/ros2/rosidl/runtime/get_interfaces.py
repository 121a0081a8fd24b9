"""`rosidl_runtime_py.get_interfaces`: which interfaces there are, by package. Here: in the catalogue."""

from __future__ import annotations

from collections.abc import Iterable

from metaros.idl.catalogue import default_catalogue

__all__ = [
    "get_action_interfaces",
    "get_interface_packages",
    "get_interface_path",
    "get_interfaces",
    "get_message_interfaces",
    "get_service_interfaces",
]


def get_interface_packages() -> dict[str, str]:
    """The packages that have interfaces, each with its prefix; shipped ones have none, which is ""."""
    return dict.fromkeys(get_interfaces(), "")


def get_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """Of each package, or of those named: "msg/String" and the like. LookupError for a package that there is not.

    A package without interfaces, such as a Python package, is one that there is not: the catalogue knows no others.
    """
    catalogue, found = default_catalogue(), dict[str, list[str]]()
    wanted = list(package_names)
    for name in [name for package in wanted for name in catalogue.names_of(package)] if wanted else catalogue.names():
        package, _, rest = name.partition("/")
        found.setdefault(package, []).append(rest)
    for package in wanted:
        if package not in found:
            raise LookupError(f"Unknown package {package}: the catalogue has no interfaces of it")
    return found


def get_message_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """The messages of each package that has any."""
    return _of_kind("msg", package_names)


def get_service_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """The services of each package that has any."""
    return _of_kind("srv", package_names)


def get_action_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """The actions of each package that has any."""
    return _of_kind("action", package_names)


def get_interface_path(interface_name: str) -> str:
    """The file of "my_msgs/msg/Own" in a folder of interfaces; LookupError for shipped ones, which have no file."""
    from metaros.idl.folders import interface_file

    kind = interface_name.split("/")[1] if interface_name.count("/") == 2 else ""
    path = interface_file(interface_name.removesuffix(f".{kind}"))
    if path is None:
        raise LookupError(f"Could not find the interface {interface_name!r} as a file")
    return str(path)


def _of_kind(kind: str, package_names: Iterable[str]) -> dict[str, list[str]]:
    listed = get_interfaces(package_names).items()
    chosen = {package: [name for name in names if name.startswith(f"{kind}/")] for package, names in listed}
    return {package: names for package, names in chosen.items() if names}
