"""Errors that are rclpy's and this library's at once."""

from __future__ import annotations

from metaros.errors import NameError_, ParameterError
from metaros.ros2.rclpy.names import exceptions
from metaros.ros2.rclpy.names.exceptions import InvalidParameterTypeException, InvalidTopicNameException
from metaros.ros2.rclpy.parameters.value import Parameter


def test_each_is_the_error_of_the_library_that_means_the_same() -> None:
    assert issubclass(exceptions.InvalidTopicNameException, NameError_)
    assert issubclass(exceptions.ParameterNotDeclaredException, ParameterError)
    assert issubclass(exceptions.NodeNameNonExistentError, RuntimeError)


def test_they_say_what_is_wrong_and_with_what() -> None:
    parameter: Parameter[str] = Parameter("speed", Parameter.Type.STRING, "fast")
    texts = {
        str(InvalidTopicNameException("a?", "no", 1)): ("Invalid topic name: no", "    ^"),
        str(exceptions.NotInitializedException("nobody")): ("rclpy.init()", "nobody"),
        str(exceptions.NoTypeSupportImportedException()): ("type support",),
        str(exceptions.ROSInterruptException()): ("shutdown()",),
        str(exceptions.ParameterNotDeclaredException("a")): ("undeclared", ": a"),
        str(exceptions.ParameterAlreadyDeclaredException(["a", "b"])): ("already declared", "['a', 'b']"),
        str(exceptions.InvalidParameterException("")): ("Invalid parameter name",),
        str(exceptions.InvalidParameterValueException("a", 1, "too small")): ("(1)", "too small", "a"),
        str(exceptions.ParameterImmutableException("a")): ("read-only", "a"),
        str(exceptions.ParameterUninitializedException("a")): ("not initialized", "a"),
        str(InvalidParameterTypeException(parameter, Parameter.Type.INTEGER)): ("'speed'", "STRING", "INTEGER"),
    }
    assert [text for text, words in texts.items() if not all(word in text for word in words)] == []
