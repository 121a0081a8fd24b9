"""Types over REST: parts and definitions, from what the library ships and from what a robot announced."""

from __future__ import annotations

from pathlib import Path

from gateway.api.models.types import TypeShape
from gateway.fleet.ros.shapes import shape_of
from metaros._proto import link_pb2
from metaros.idl import default_catalogue
from tests.gateway.harness import DATA, ScriptedAgent, client, running_gateway

TYPES = "/api/v1/robots/sim_1/types"
OWN = (
    "float32 level 0.5\nLamp[<=2] lamps\nuint8 OFF=0\n"
    + "=" * 80
    + '\nMSG: shop/Lamp\nstring<=8 name "x"\nbool[3] on\n'
)


async def test_shipped_and_announced_types_are_reported(tmp_path: Path) -> None:
    own = link_pb2.Channel(channel_id=1, topic="/sim_1/lamps", encoding="cdr", schema_name="shop/msg/Lamps")
    own.schema_encoding, own.schema, own.forward = "ros2msg", OWN.encode(), True
    setattr(own, "class", 3)
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        await agent.announce(own)
        await agent.samples(1, 1, [b"x"])
        await agent.next("ack", DATA)
        twist = (await http.get(f"{TYPES}/geometry_msgs/msg/Twist")).json()
        assert twist["parts"] == {"message": "geometry_msgs/msg/Twist"}
        assert set(twist["definitions"]) == {"geometry_msgs/msg/Twist", "geometry_msgs/msg/Vector3"}
        assert twist["text"] == "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"
        call = TypeShape.model_validate_json((await http.get(f"{TYPES}/std_srvs/srv/SetBool")).content)
        assert call.parts == {"request": "std_srvs/srv/SetBool_Request", "response": "std_srvs/srv/SetBool_Response"}
        assert [item.name for item in call.definitions["std_srvs/srv/SetBool_Response"].fields] == [
            "success",
            "message",
        ]
        lamps = (await http.get(f"{TYPES}/shop/msg/Lamps")).json()
        level, inner = lamps["definitions"]["shop/msg/Lamps"]["fields"]
        assert (level["type"], level["default"]) == ("float32", 0.5)
        assert (inner["type"], inner["array"], inner["capacity"]) == ("shop/msg/Lamp", "bounded", 2)
        assert lamps["definitions"]["shop/msg/Lamps"]["constants"] == [{"name": "OFF", "type": "uint8", "value": 0}]
        assert lamps["definitions"]["shop/msg/Lamp"]["fields"][0]["string_bound"] == 8


async def test_what_is_not_known_is_refused(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready):
        for path in (f"{TYPES}/shop/msg/Lamps", f"{TYPES}/std_msgs/odd/String"):
            answer = await http.get(path)
            assert (answer.status_code, answer.json()["code"]) == (400, "unknown_type"), path
        answer = await http.get("/api/v1/robots/nobody/types/std_msgs/msg/String")
        assert answer.json()["code"] == "unknown_robot"


def test_every_shipped_type_has_a_shape() -> None:
    catalogue = default_catalogue()
    names = catalogue.names()
    assert {name.split("/")[1] for name in names} == {"msg", "srv", "action"}
    for name in names:
        shape = TypeShape.model_validate(shape_of(name, catalogue))
        assert set(shape.parts.values()) <= shape.definitions.keys()
        used = {item.type for one in shape.definitions.values() for item in one.fields if "/" in item.type}
        assert used <= shape.definitions.keys()
