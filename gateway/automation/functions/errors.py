"""What can be wrong about functions; each with its code in the gateway's table, and an AWS name in `gateway.api.aws`.

RequestError
├── UnknownFunctionError       no such function, version, alias, layer, mapping or setting   unknown_function
├── FunctionConflictError      there is one already, or it is being changed                  function_conflict
├── FunctionInvalidError       a setting does not fit; the message names it                  function_invalid
│   └── NotImplementedHereError    an operation or setting of AWS that is not here           function_unsupported
├── FunctionChangedError       the RevisionId is another by now                              function_changed
├── CodeStorageFullError       all code together is over its bound                           function_code_full
├── PolicyTooLongError         a policy has no room for another statement                    function_policy_long
├── NoProvisionedError         nothing is kept warm for this qualifier                       function_not_provisioned
├── FunctionsOffError          no function runs at this gateway                              functions_off
└── PayloadInvalidError        what a function is called with is no JSON                     function_payload_invalid
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = [
    "CodeStorageFullError",
    "FunctionChangedError",
    "FunctionConflictError",
    "FunctionInvalidError",
    "FunctionsOffError",
    "NoProvisionedError",
    "NotImplementedHereError",
    "PayloadInvalidError",
    "PolicyTooLongError",
    "UnknownFunctionError",
]


class UnknownFunctionError(RequestError):
    """There is no such function, version, alias, layer, event source mapping or setting of one."""

    code = "unknown_function"


class FunctionConflictError(RequestError):
    """There is something of that name already."""

    code = "function_conflict"


class FunctionInvalidError(RequestError):
    """A setting does not fit; the message names it and its bound."""

    code = "function_invalid"


class NotImplementedHereError(FunctionInvalidError):
    """AWS Lambda has it and Meta-ROS has not; the message names it."""

    code = "function_unsupported"


class FunctionChangedError(RequestError):
    """Somebody else was faster: the RevisionId is another one by now."""

    code = "function_changed"


class CodeStorageFullError(RequestError):
    """All code that is kept would be over its bound."""

    code = "function_code_full"


class PolicyTooLongError(RequestError):
    """A resource's policy has no room for another statement."""

    code = "function_policy_long"


class NoProvisionedError(RequestError):
    """Nothing is kept warm for this version or alias."""

    code = "function_not_provisioned"


class FunctionsOffError(RequestError):
    """No function runs at this gateway; the message says why."""

    code = "functions_off"


class PayloadInvalidError(RequestError):
    """What a function is to be called with is no JSON."""

    code = "function_payload_invalid"
