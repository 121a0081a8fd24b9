"""The extras of the distribution, and whether what they bring is installed. Nothing is imported for it."""

from __future__ import annotations

from importlib.util import find_spec

from metaros.errors import ConfigError

__all__ = ["EXTRAS", "missing_modules", "require"]

EXTRAS: dict[str, tuple[str, ...]] = {
    "agent": ("edge_agent", "grpc", "google.protobuf", "psutil"),
    "gateway": ("gateway", "fastapi", "uvicorn", "websockets", "grpc", "google.protobuf", "orjson"),
    "drivers": ("cv2", "serial", "psutil"),
    "video": ("av",),
    "can": ("can", "cantools"),
    "mavlink": ("pymavlink",),
    "postgres": ("asyncpg",),
    "zmq": ("zmq",),
    "dds": ("cyclonedds",),
}


def missing_modules(extra: str) -> list[str]:
    """The modules of an extra that cannot be found."""
    return [name for name in EXTRAS[extra] if not _found(name)]


def require(*extras: str) -> None:
    """ConfigError that says what to install, where anything of these extras is missing."""
    lacking = {extra: missing for extra in extras if (missing := missing_modules(extra))}
    if lacking:
        modules = sorted({name for missing in lacking.values() for name in missing})
        raise ConfigError(
            f"these Python modules are missing: {', '.join(modules)}\n"
            f"install them with: pip install 'metaros[{','.join(lacking)}]'"
        )


def _found(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:  # the parent package is missing
        return False
