"""What is told from a message, and a message from a service."""

from __future__ import annotations

import pytest

from metaros.ros2.rclpy.core.rcl_errors import RMWError
from metaros.ros2.rclpy.core.serialization import deserialize_message, serialize_message
from metaros.ros2.rclpy.names import type_support
from metaros.ros2.rclpy.names.exceptions import NoTypeSupportImportedException
from metaros.ros2.rosidl.catalogue import interface


class _Meta(type):
    _TYPE_SUPPORT = None

    @classmethod
    def __import_type_support__(cls) -> None:
        """There is nothing."""


class _Imitation(metaclass=_Meta):
    pass


def test_each_kind_is_known() -> None:
    message, service = interface("std_msgs/msg/String"), interface("std_srvs/srv/Trigger")
    action = interface("example_interfaces/action/Fibonacci")
    checks = {
        type_support.check_is_valid_msg_type: message,
        type_support.check_is_valid_srv_type: service,
        type_support.check_is_valid_action_type: action,
    }
    for check, good in checks.items():
        type_support.check_for_type_support(good)
        check(good)
        for other in checks.values():
            if other is not good:
                with pytest.raises(RuntimeError, match="type provided is not valid"):
                    check(other)
    with pytest.raises(AttributeError, match=r"std_msgs\.msg\.String"):
        type_support.check_for_type_support(object())
    with pytest.raises(NoTypeSupportImportedException):
        type_support.check_for_type_support(_Imitation)


def test_messages_go_to_bytes_and_back() -> None:
    text = interface("std_msgs/msg/String")
    sent = serialize_message(text(data="häy"))
    assert sent[:4] == b"\0\1\0\0"
    assert deserialize_message(sent, text) == text(data="häy")
    with pytest.raises(RMWError, match="String"):
        deserialize_message(b"\0\1\0\0\xff", text)
    with pytest.raises(AttributeError):
        serialize_message("text")
