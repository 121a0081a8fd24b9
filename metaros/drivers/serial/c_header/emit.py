"""The C text of a struct, its encoder and its decoder. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from metaros.drivers.serial.c_header.types import NUMBERS, Member, Struct

__all__ = ["emit_struct"]


def emit_struct(struct: Struct, *, dds_type: str, type_hash: str) -> str:
    """Everything of one message: names, constants, struct, the code within others, the code for whole messages."""
    lines = [f"/* {struct.ros_name} */"]
    lines += [f'#define {struct.name}_TYPE "{struct.ros_name}"']
    lines += [f'#define {struct.name}_DDS_TYPE "{dds_type}"', f'#define {struct.name}_HASH "{type_hash}"']
    lines += list(_constants(struct))
    lines += ["typedef struct {", *(f"    {text}" for text in _members(struct)), f"}} {struct.name};", ""]
    lines += [f"static inline void {struct.name}_put(metaros_writer *w, const {struct.name} *m) {{"]
    lines += [f"    {text}" for text in _body(struct, _put, empty="metaros_put(w, 0, 1);")] + ["    (void)m;", "}", ""]
    lines += [f"static inline void {struct.name}_get(metaros_reader *r, {struct.name} *m) {{"]
    lines += [f"    {text}" for text in _body(struct, _get, empty="metaros_get(r, 1);")] + ["    (void)m;", "}", ""]
    return "\n".join([*lines, _WHOLE.replace("NAME", struct.name)])


_WHOLE = """\
/* The bytes written, header included; 0 where they do not fit. */
static inline size_t NAME_encode(const NAME *m, uint8_t *out, size_t capacity) {
    metaros_writer w = metaros_begin_write(out, capacity);
    NAME_put(&w, m);
    return w.ok ? w.at + 4 : 0;
}

/* Whether the bytes were a whole message that fits the struct. */
static inline bool NAME_decode(NAME *m, const uint8_t *data, size_t size) {
    metaros_reader r = metaros_begin_read(data, size);
    memset(m, 0, sizeof *m);
    NAME_get(&r, m);
    return r.ok;
}
"""


def _constants(struct: Struct) -> Iterator[str]:
    for constant in struct.constants:
        value = constant.value
        if isinstance(value, bool):
            text = "true" if value else "false"
        elif isinstance(value, str):
            escaped = "".join(c if c.isalnum() or c in " _-./" else f"\\{ord(c):03o}" for c in value if ord(c) < 128)
            text = f'"{escaped}"'
        else:
            text = f"({value!r})"
            if isinstance(value, int) and not -(2**31) <= value < 2**31:
                text = f"({value}{'ULL' if value > 0 else 'LL'})"
        yield f"#define {struct.name}_{constant.name} {text}"


def _members(struct: Struct) -> Iterator[str]:
    if not struct.members:
        yield "uint8_t nothing; /* C has no empty structs */"
    for member in struct.members:
        if member.counted:
            yield f"uint32_t {member.name}_count;"
        sizes = "".join(f"[{size}]" for size in (member.capacity, member.text_size) if size)
        yield f"{member.c_type} {member.name}{sizes};"


def _body(struct: Struct, one: Callable[[Member, str], str], *, empty: str) -> Iterator[str]:
    if not struct.members:
        yield empty  # ROS 2 gives a message without fields one byte
    for member in struct.members:
        if not member.capacity:
            yield one(member, f"m->{member.name}")
            continue
        writing = one is _put
        most = member.capacity
        if member.counted and writing:
            count = f"metaros_put_count(w, m->{member.name}_count, {most})"
        elif member.counted:
            yield f"m->{member.name}_count = metaros_get_count(r, {most});"
            count = f"m->{member.name}_count"
        else:
            count = most
        yield f"for (uint32_t i = 0, n = {count}; i < n; i++) {one(member, f'm->{member.name}[i]')}"


def _put(member: Member, value: str) -> str:
    if member.text_size:
        return f"metaros_put_string(w, {value}, {member.text_size});"
    if member.base not in NUMBERS:
        return f"{member.c_type}_put(w, &{value});"
    if member.base == "float32":
        return f"metaros_put_float(w, {value});"
    if member.base == "float64":
        return f"metaros_put_double(w, {value});"
    return f"metaros_put(w, (uint64_t){value}, {NUMBERS[member.base][1]});"


def _get(member: Member, value: str) -> str:
    if member.text_size:
        return f"metaros_get_string(r, {value}, {member.text_size});"
    if member.base not in NUMBERS:
        return f"{member.c_type}_get(r, &{value});"
    if member.base == "float32":
        return f"{value} = metaros_get_float(r);"
    if member.base == "float64":
        return f"{value} = metaros_get_double(r);"
    c_type, size = NUMBERS[member.base]
    return f"{value} = ({c_type})metaros_get(r, {size});"
