"""ROS names and types as DDS spells them."""

from __future__ import annotations

from metaros.dds.names import Kind, RosName, dds_topic, dds_type, parse_topic, parse_type


def test_names_go_there_and_back() -> None:
    table = {
        "rt/chatter": RosName(Kind.TOPIC, "/chatter"),
        "rt/robot_1/tf": RosName(Kind.TOPIC, "/robot_1/tf"),
        "rq/ns/addRequest": RosName(Kind.REQUEST, "/ns/add"),
        "rr/ns/addReply": RosName(Kind.REPLY, "/ns/add"),
        "rt/fibonacci/_action/feedback": RosName(Kind.TOPIC, "/fibonacci/_action/feedback"),
    }
    found = {topic: parse_topic(topic) for topic in table}
    assert found == table
    assert {dds_topic(name.kind, name.name) for name in table.values()} == set(table)
    foreign = ("ros_discovery_info", "chatter", "rt/", "rt/a b", "rt/1a", "rq/add", "rq/Request", "DCPSParticipant", "")
    assert {topic: parse_topic(topic) for topic in foreign} == dict.fromkeys(foreign)


def test_types_of_messages_and_of_the_halves_of_services() -> None:
    table = {
        (Kind.TOPIC, "std_msgs::msg::dds_::String_"): "std_msgs/msg/String",
        (Kind.REQUEST, "std_srvs::srv::dds_::Trigger_Request_"): "std_srvs/srv/Trigger",
        (Kind.REPLY, "std_srvs::srv::dds_::Trigger_Response_"): "std_srvs/srv/Trigger",
        (Kind.REQUEST, "a::action::dds_::Go_SendGoal_Request_"): "a/action/Go_SendGoal",
        (Kind.REPLY, "std_srvs::srv::dds_::Trigger_Request_"): "",
        (Kind.TOPIC, "HelloWorld"): "",
    }
    assert {key: parse_type(*key) for key in table} == table
    assert dds_type("std_msgs/msg/String") == "std_msgs.msg.dds_.String_"
