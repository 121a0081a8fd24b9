"""The whole header file for a list of types."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from metaros.drivers.serial.c_header.emit import emit_struct
from metaros.drivers.serial.c_header.types import structs_of
from metaros.errors import ConfigError
from metaros.idl import default_catalogue, type_hash
from metaros.wire.names import dds_name

__all__ = ["MAX_TYPES", "render_header"]

MAX_TYPES: Final = 64
_RUNTIME: Final = Path(__file__).with_name("runtime.h")
_HEAD: Final = """\
/* Written by `metaros driver header {types}`.
 *
 * C99, nothing allocated, no floating point needed where no message has any. Structs hold at most METAROS_STRING_BYTES
 * of a text (its end included) and METAROS_SEQUENCE_MAX elements of a sequence: define others before including this.
 * What does not fit is refused, by 0 or false, never cut.
 */
#ifndef METAROS_H
#define METAROS_H

#ifndef METAROS_STRING_BYTES
#define METAROS_STRING_BYTES 64
#endif
#ifndef METAROS_SEQUENCE_MAX
#define METAROS_SEQUENCE_MAX 64
#endif

"""


def render_header(type_names: Sequence[str]) -> str:
    """C99 for these types. Raises ConfigError (none, or too many), UnknownTypeError, DefinitionError."""
    if not 1 <= len(type_names) <= MAX_TYPES:
        raise ConfigError(f"give 1 to {MAX_TYPES} types, such as geometry_msgs/msg/Twist")
    catalogue = default_catalogue()
    structs = structs_of(type_names, catalogue)
    parts = [_HEAD.format(types=" ".join(type_names)), _RUNTIME.read_text(encoding="utf-8"), "\n"]
    parts.append("/* -- Messages --------------------------------------------------------------------------- */\n\n")
    for struct in structs:
        hashed = type_hash(struct.ros_name, catalogue)
        parts.append(emit_struct(struct, dds_type=dds_name(struct.ros_name), type_hash=hashed) + "\n")
    return "".join([*parts, "#endif\n"])
