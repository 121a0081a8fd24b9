"""Every line that the parser sees is a step, whatever ends it; counting stops where it is enough."""

from __future__ import annotations

from metaros._proto import link_pb2
from metaros.link.parse_cost import COUNTED, TYPE_STEPS, parse_cost


def one(text: str, *, name: str = "p/msg/A") -> link_pb2.TypeText:
    return link_pb2.TypeText(type_name=name, parts=[link_pb2.TypePart(name=name, text=text)])


def test_every_character_that_ends_a_line_is_counted() -> None:
    ends = {chr(code) for code in range(0x1_0000) if len(f"a{chr(code)}b".splitlines()) > 1}
    assert ends <= set(COUNTED)
    for end in ends:
        assert parse_cost(one(f"int8 a{end}" * 100), enough=1000) > TYPE_STEPS + 100


def test_default_values_plain_text_and_parts_are_counted() -> None:
    least = parse_cost(one(""), enough=1000)
    assert parse_cost(one("int8[] a [" + "1," * 100 + "1]"), enough=1000) >= least + 100
    assert parse_cost(one("string a '" + "x" * 6400), enough=1000) >= least + 100
    assert parse_cost(one("", name="p/action/A"), enough=1000) > least


def test_it_is_not_counted_beyond_what_is_enough() -> None:
    many = link_pb2.TypeText(type_name="p/msg/A", parts=[link_pb2.TypePart(name="p/msg/A", text="\n" * 9)] * 10_000)
    assert 500 < parse_cost(many, enough=500) < 5000 < parse_cost(many, enough=1_000_000)
