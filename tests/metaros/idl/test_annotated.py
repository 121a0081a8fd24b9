"""`@message` classes as Python: construction, values, inheritance, pickling; and annotations that have no ROS type."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Annotated, Any, ClassVar, Optional

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import metaros
from metaros.cdr import codec
from metaros.errors import DecodeError, FieldError
from metaros.idl import Catalogue, catalogue_of, definition_text, message_class, schema_text
from metaros.idl.annotated_names import field_name
from metaros.idl.json import from_json, to_json
from metaros.interfaces.geometry_msgs.msg import Point, Vector3
from metaros.interfaces.std_msgs.msg import Header
from tests.support.tables import cases


class Mode(IntEnum):
    """Small numbers."""

    IDLE = 0
    RUN = 3


class Colour(str, Enum):  # noqa: UP042 - the older way to say it works too
    """Texts."""

    RED = "red"
    BLUE = "blue"


@metaros.message
class Cell:
    """A battery's cell."""

    volts: float = 3.5
    name: str = "c"

    def is_low(self) -> bool:
        """Methods stay."""
        return self.volts < 3.0


@metaros.message
class Battery:
    """With everything."""

    MAX_CELLS: ClassVar[metaros.uint8] = 7
    shared: ClassVar[dict[str, int]] = {}

    header: Header
    mode: Annotated[Mode, metaros.Exact("uint8")] = Mode.RUN
    colour: Colour = Colour.BLUE
    modes: list[Mode]
    cells: list[Cell]
    raw: bytes = b"\x01\x02"
    key: Annotated[bytes, metaros.Fixed(4)]
    temps: list[metaros.float32] = field(default_factory=lambda: [20.5])
    flags: Annotated[list[bool], metaros.Bounded(3)]
    xyz: tuple[float, float, float] = (1, 2, 3)
    ids: tuple[metaros.uint16, ...] = ()
    grid: Annotated[NDArray[np.float32], metaros.Shape(2, 3)]
    rows: Annotated[NDArray[np.float64], metaros.Shape(None, 3)]
    line: NDArray[np.int16]
    names: list[Annotated[str, metaros.Bounded(5)]]
    label: Annotated[str, metaros.Bounded(10)] = "hi"
    ok: bool = True
    from_: int = 5


def through(message: Any) -> Any:
    code = codec(type(message))
    return code.decode(code.encode(message))


def test_defaults_and_the_values_that_fields_hold() -> None:
    battery = Battery()
    assert (battery.mode, battery.colour, battery.modes, battery.cells) == (Mode.RUN, Colour.BLUE, [], [])
    assert (battery.raw, battery.key, battery.temps, battery.flags) == (b"\x01\x02", b"\0\0\0\0", [20.5], [])
    assert (battery.xyz, battery.ids, battery.label, battery.ok, battery.from_) == ((1, 2, 3), (), "hi", True, 5)
    assert (battery.grid.tolist(), battery.rows.shape, battery.line.dtype) == ([[0] * 3] * 2, (0, 3), np.int16)
    assert Battery().header is not battery.header
    assert Battery().temps is not battery.temps
    assert Battery().grid is not battery.grid
    assert (Battery.MAX_CELLS, Battery.shared) == (7, {})


def test_values_cross_and_come_back_as_what_they_were() -> None:
    battery = Battery(
        header=Header(frame_id="b"),
        mode=Mode.IDLE,
        colour=Colour.RED,
        modes=[Mode.RUN, Mode.IDLE],
        cells=[Cell(volts=2.5), Cell(name="d")],
        raw=bytearray(b"\xff"),
        key=b"abcd",
        temps=[1, 2.5],
        flags=[True, False],
        xyz=[4, 5, 6],
        ids=(1, 65535),
        grid=np.arange(6),
        rows=[[1, 2, 3], [4, 5, 6]],
        line=[1, -2],
        names=["a", "bcdef"],
    )
    back = through(battery)
    assert type(back) is Battery
    assert back == battery
    assert (type(back.mode), type(back.colour), back.modes) == (Mode, Colour, [Mode.RUN, Mode.IDLE])
    assert [cell.is_low() for cell in back.cells] == [True, False]
    assert (back.raw, back.temps, back.flags, back.xyz, back.ids) == (
        b"\xff",
        [1.0, 2.5],
        [True, False],
        (4, 5, 6),
        (1, 65535),
    )
    assert back.grid.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert back.rows.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert back != Battery()
    assert back != "battery"
    assert from_json(Battery, to_json(battery)) == battery


def test_assignment_converts_and_refuses_what_has_another_shape() -> None:
    battery = Battery()
    battery.grid = [[1, 2, 3], [4, 5, 6]]
    assert battery.grid.dtype == np.float32
    battery.temps.append(3)
    battery.raw = memoryview(b"xy")
    assert (through(battery).temps, through(battery).raw) == ([20.5, 3.0], b"xy")
    with pytest.raises(FieldError, match=r"Battery\.grid: an array of shape \(3, 2\) is not of shape \(2, 3\)"):
        battery.grid = np.zeros((3, 2))
    with pytest.raises(FieldError, match=r"Battery\.rows: an array of shape \(4,\) is not of shape \(any, 3\)"):
        battery.rows = np.zeros(4)
    with pytest.raises(FieldError, match=r"Battery\.rows: the rows are of different lengths"):
        battery.rows = [[1, 2, 3], [4]]
    with pytest.raises(FieldError, match=r"Battery\.raw: "):
        battery.raw = "text"
    with pytest.raises(FieldError, match=r"Battery\.temps: expected a list of numbers, got str"):
        battery.temps = "12"
    with pytest.raises(FieldError, match="flags: 4 elements, at most 3 are allowed"):
        codec(Battery).encode(Battery(flags=[True] * 4))
    with pytest.raises(FieldError, match="Battery has no field 'colr'; its fields are: header"):
        Battery(colr=1)
    with pytest.raises(AttributeError):
        battery.colr = 1


def test_a_value_of_a_newer_peer_is_kept_as_it_is() -> None:
    battery = Battery()
    battery.mode = 9
    back = through(battery)
    assert (back.mode, type(back.mode)) == (9, int)


def test_it_is_a_pleasant_class() -> None:
    battery = Battery(cells=[Cell()])
    assert repr(Cell(volts=1.0)) == "Cell(volts=1.0, name='c')"
    assert "cells=[Cell(volts=3.5, name='c')], raw=b'\\x01\\x02'" in repr(battery)
    assert (Battery.__doc__, Battery.__module__, Battery.__qualname__) == ("With everything.", __name__, "Battery")
    assert pickle.loads(pickle.dumps(battery)) == battery
    assert pickle.loads(pickle.dumps(battery)).grid.shape == (2, 3)
    copied = copy.deepcopy(battery)
    copied.cells[0].volts = 0.0
    assert battery.cells[0].volts == 3.5
    assert Cell.__annotations__ == {"volts": "float", "name": "str"}
    assert not hasattr(battery, "__dict__")
    with pytest.raises(TypeError):
        hash(battery)


def test_the_definition_says_it_all() -> None:
    assert Battery.__metaros_name__ == "tests/msg/Battery"
    text = schema_text("tests/msg/Battery", Battery.__metaros_catalogue__)
    assert text.startswith("uint8 MAX_CELLS=7\nuint8 MODE_IDLE=0\nuint8 MODE_RUN=3\nstring COLOUR_RED=")
    for line in (
        "uint8 mode 3",
        'string colour "blue"',
        "tests/Cell[] cells",
        "uint8[] raw [1, 2]",
        "uint8[4] key",
        "float32[] temps",
        "bool[<=3] flags",
        "float64[3] xyz [1.0, 2.0, 3.0]",
        "uint16[] ids",
        "float32[6] grid",
        "float64[] rows",
        "string<=5[] names",
        'string<=10 label "hi"',
        "int64 from 5",
    ):
        assert f"\n{line}\n" in text
    assert message_class("tests/msg/Battery") is Battery
    assert catalogue_of("tests/msg/Battery", Battery.__metaros_hash__) is not None
    assert catalogue_of("tests/msg/Battery", "RIHS01_" + "0" * 64) is None


def test_defaults_that_no_msg_file_holds_stay_in_python() -> None:
    @metaros.message(catalogue=Catalogue())
    class Far:
        range_max: float = float("inf")
        unknown: metaros.float32 = float("nan")
        text: str = 'a "quote", a \\ and\na line'
        pair: tuple[float, ...] = (1.0, float("nan"))

    text = schema_text(Far.__metaros_name__, Far.__metaros_catalogue__)
    assert text.startswith('float64 range_max\nfloat32 unknown\nstring text "a ')
    assert (Far().range_max, Far().pair[0], Far().text) == (float("inf"), 1.0, 'a "quote", a \\ and\na line')


def test_inheritance_super_and_post_init() -> None:
    @metaros.message
    class Animal:
        legs: metaros.uint8 = 4
        shape: Annotated[NDArray[np.uint8], metaros.Shape(2, 2)]

        def tell(self) -> str:
            return f"{self.legs} legs"

    @metaros.message
    class Bird(Animal):
        wings: int = 2

        def __post_init__(self) -> None:
            self.legs = 2

        def tell(self) -> str:
            return f"{super().tell()}, {self.wings} wings, {__class__.__name__}"  # type: ignore[name-defined]

    bird = Bird(shape=[[1, 2], [3, 4]])
    assert bird.tell() == "2 legs, 2 wings, Bird"
    assert through(bird) == bird
    assert through(bird).shape.tolist() == [[1, 2], [3, 4]]
    assert [item.name for item in Bird.__metaros_fields__] == ["legs", "shape", "wings"]
    with pytest.raises(FieldError, match=r"Penguin\.legs: a base class has a field of this name"):

        @metaros.message
        class Penguin(Bird):
            legs: int = 2


def test_a_class_made_anew_with_other_fields_has_its_own_codec() -> None:
    def make(kind: Any) -> Any:
        class Again:
            value: kind  # type: ignore[valid-type]

        Again.__annotations__ = {"value": kind}
        return metaros.message(name="again_msgs/msg/Again")(Again)

    first, second, third = make(int), make(str), make(int)
    assert first.__metaros_hash__ == third.__metaros_hash__ != second.__metaros_hash__
    assert type(through(second(value="x"))) is second
    assert type(through(third(value=1))) is third
    assert catalogue_of("again_msgs/msg/Again", second.__metaros_hash__) is second.__metaros_catalogue__

    class Outer:
        inner: third

    Outer.__annotations__ = {"inner": third}
    outer = metaros.message(name="again_msgs/msg/Outer")(Outer)
    assert type(through(outer()).inner) is third


@dataclass
class NotDecorated:
    """A dataclass is no message."""

    x: int = 0


class PlainEnum(Enum):
    """Neither int nor str."""

    A = object()


BAD: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    ({"x": Optional[int]}, {}, r"Bad\.x: .*ROS fields always have a value of one type"),  # noqa: UP045
    ({"x": int | None}, {}, r"Bad\.x: .*ROS fields always have a value"),
    ({"x": dict[str, int]}, {}, r"Bad\.x: dict.* has no ROS type: use a list of messages"),
    ({"x": Any}, {}, r"Bad\.x: .*says nothing about the type"),
    ({"x": "Bad"}, {}, r"Bad\.x: Bad contains itself"),
    ({"x": "list[Bad]"}, {}, r"Bad\.x: Bad contains itself"),
    ({"x": "Missing"}, {}, r"Bad: an annotation names 'Missing', which is not defined here"),
    ({"x": NotDecorated}, {}, r"Bad\.x: NotDecorated is no message class: decorate it"),
    ({"x": complex}, {}, r"Bad\.x: complex has no ROS type"),
    ({"x": np.float32}, {}, r"Bad\.x: numpy\.float32 is for arrays; for one value use metaros\.float32"),
    ({"x": np.ndarray}, {}, r"Bad\.x: an array needs a dtype"),
    ({"x": NDArray[np.complex64]}, {}, r"Bad\.x: an array needs a dtype that ROS has"),
    ({"x": list}, {}, r"Bad\.x: a list needs the type of its elements"),
    ({"x": list[list[int]]}, {}, r"Bad\.x: ROS has no sequence of sequences"),
    ({"x": tuple[int, float]}, {}, r"Bad\.x: a tuple is of one numeric type"),
    ({"x": tuple[str, str]}, {}, r"Bad\.x: a tuple is of numbers"),
    ({"x": PlainEnum}, {}, r"Bad\.x: the enum PlainEnum has no wire form"),
    ({"x": Annotated[int, metaros.Exact("float32")]}, {}, r"Bad\.x: int cannot be float32"),
    ({"x": Annotated[int, metaros.Bounded(3)]}, {}, r"Bad\.x: Bounded is for str"),
    ({"x": Annotated[str, metaros.Bounded(0)]}, {}, r"Bad\.x: a size of 0"),
    ({"x": Annotated[list[int], metaros.Shape(3)]}, {}, r"Bad\.x: Shape has no meaning here"),
    ({"x": Annotated[list[int], metaros.Fixed(2), metaros.Bounded(3)]}, {}, r"Bad\.x: Bounded and Fixed exclude"),
    ({"myValue": int}, {}, r"Bad\.myValue: the name is illegal in ROS: .*perhaps my_value"),
    ({"_x": int}, {}, r"Bad\._x: the name is illegal in ROS"),
    ({"x__y": int}, {}, r"Bad\.x__y: the name is illegal in ROS"),
    ({"x": list[int]}, {"x": []}, r"Bad\.x: the default could be changed"),
    ({"x": NDArray[np.float32]}, {"x": np.zeros(2)}, r"Bad\.x: the default could be changed"),
    ({"x": Point}, {"x": Point()}, r"Bad\.x: the default could be changed"),
    ({"x": int}, {"x": "1"}, r"Bad\.x: the default '1' does not fit int64"),
    ({"x": int}, {"x": None}, r"Bad\.x: the default None does not fit int64"),
    ({"x": metaros.uint8}, {"x": 300}, r"Bad: .*300 does not fit uint8"),
    ({"X_MAX": ClassVar[int]}, {}, r"Bad\.X_MAX: a constant needs a value"),
    ({"X_MAX": ClassVar[list[int]]}, {"X_MAX": [1]}, r"Bad\.X_MAX: a constant is a number"),
]


@cases(("hints", "values", "message"), BAD)
def test_what_cannot_be_mapped_is_reported_with_class_and_field(
    hints: dict[str, Any], values: dict[str, Any], message: str
) -> None:
    cls = type("Bad", (), {"__annotations__": hints, "__module__": __name__, **values})
    with pytest.raises(FieldError, match=message):
        metaros.message(cls)


def test_classes_that_cannot_be_messages() -> None:
    for bad, message in [
        (NotDecorated, "use @metaros.message alone, without @dataclass"),
        (Cell, "it is a message class already"),
        (Mode, "a class derived from IntEnum cannot be a message"),
        (type("lower", (), {}), "'lower' is illegal as a ROS type name"),
        (type("Slotted", (), {"__slots__": ()}), "leave __slots__ out"),
    ]:
        with pytest.raises(FieldError, match=message):
            metaros.message(bad)
    with pytest.raises(FieldError, match="'Nice' is no message name like my_robot/msg/Battery"):
        metaros.message(name="Nice")(type("Nice", (), {}))
    with pytest.raises(FieldError, match=r"Shape.*whole numbers above 0"):
        metaros.Shape(3, None)
    assert field_name("class_") == "class"


def test_no_fields_at_all_are_an_empty_message() -> None:
    @metaros.message(catalogue=Catalogue())
    class Nothing:
        pass

    assert through(Nothing()) == Nothing()
    assert codec(Nothing).encode(Nothing()) == b"\0\1\0\0\0"
    with pytest.raises(DecodeError):
        codec(Nothing).decode(b"\0\1")


FLOATS = st.floats(width=32, allow_nan=False)


@settings(max_examples=30, deadline=None)
@given(
    st.builds(
        Battery,
        mode=st.sampled_from(Mode),
        colour=st.sampled_from(Colour),
        modes=st.lists(st.sampled_from(Mode), max_size=3),
        cells=st.lists(
            st.builds(Cell, volts=st.floats(allow_nan=False), name=st.text("abcß ", max_size=5)), max_size=3
        ),
        raw=st.binary(max_size=9),
        key=st.binary(min_size=4, max_size=4),
        temps=st.lists(FLOATS, max_size=4),
        flags=st.lists(st.booleans(), max_size=3),
        xyz=st.tuples(FLOATS, FLOATS, FLOATS),
        ids=st.lists(st.integers(0, 65535), max_size=3).map(tuple),
        grid=st.lists(FLOATS, min_size=6, max_size=6),
        rows=st.lists(st.tuples(FLOATS, FLOATS, FLOATS), max_size=3),
        line=st.lists(st.integers(-32768, 32767), max_size=3),
        names=st.lists(st.text("abc", max_size=5), max_size=3),
        from_=st.integers(-(2**63), 2**63 - 1),
    )
)
def test_any_value_crosses(battery: Battery) -> None:
    assert through(battery) == battery
    by_name = codec("tests/msg/Battery").decode(codec(Battery).encode(battery))
    assert by_name == battery


def test_rosbags_reads_the_definition_and_agrees_on_the_hash() -> None:
    home = Battery.__metaros_catalogue__
    store = get_typestore(Stores.EMPTY)
    types: dict[str, Any] = {}
    for name in ("tests/msg/Battery", *home.dependencies("tests/msg/Battery")):
        types.update(get_types_from_msg(definition_text(home.get(name)), name))
    store.register(types)
    assert store.hash_rihs01("tests/msg/Battery") == Battery.__metaros_hash__
    data = codec(Battery).encode(Battery(names=["a"], temps=[1.5], ids=(3, 4)))
    received = store.deserialize_cdr(data, "tests/msg/Battery")
    assert (received.colour, received.temps.tolist(), received.ids.tolist(), received.label) == (
        "blue",
        [1.5],
        [3, 4],
        "hi",
    )
    assert bytes(store.serialize_cdr(received, "tests/msg/Battery")) == data


def test_a_shipped_type_rebuilt_keeps_its_shipped_class_for_all_others() -> None:
    @metaros.message(name="geometry_msgs/msg/Accel")
    class Accel:
        linear: Vector3
        angular: Vector3

    shipped = message_class("geometry_msgs/msg/Accel")
    assert shipped is not Accel
    assert shipped.__metaros_hash__ == Accel.__metaros_hash__
    assert type(through(Accel())) is Accel
    assert type(through(shipped())) is shipped
