"""Every error code in one table: its HTTP and gRPC status and what it means; `gateway.errors` looks them up."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ERRORS", "ErrorRow"]


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """What a code means to a client."""

    code: str
    http: int
    grpc: str
    title: str


ERRORS: tuple[ErrorRow, ...] = (
    ErrorRow("invalid_request", 400, "INVALID_ARGUMENT", "The request does not fit"),
    ErrorRow("invalid_name", 400, "INVALID_ARGUMENT", "A ROS name breaks the grammar"),
    ErrorRow("invalid_definition", 400, "INVALID_ARGUMENT", "An interface definition cannot be parsed"),
    ErrorRow("invalid_field", 400, "INVALID_ARGUMENT", "A value does not fit its field"),
    ErrorRow("unknown_type", 400, "INVALID_ARGUMENT", "No such interface type is known"),
    ErrorRow("malformed_cdr", 400, "INVALID_ARGUMENT", "The bytes are no CDR of that type"),
    ErrorRow("twin_invalid", 400, "INVALID_ARGUMENT", "The twin's document cannot be"),
    ErrorRow("selector_invalid", 400, "INVALID_ARGUMENT", "A selector or a label breaks the grammar"),
    ErrorRow("sign_in", 401, "UNAUTHENTICATED", "Sign in, or send a key"),
    ErrorRow("bad_credentials", 401, "UNAUTHENTICATED", "The credentials are not good, or not any more"),
    ErrorRow("csrf", 403, "PERMISSION_DENIED", "The session's token is missing from X-CSRF-Token"),
    ErrorRow("forbidden", 403, "PERMISSION_DENIED", "The role does not suffice"),
    ErrorRow("host_not_allowed", 403, "PERMISSION_DENIED", "The Host header is not allowed"),
    ErrorRow("origin_not_allowed", 403, "PERMISSION_DENIED", "The Origin is not allowed"),
    ErrorRow("proxy_only", 403, "PERMISSION_DENIED", "Only this gateway's proxies may connect"),
    ErrorRow("out_of_scope", 403, "PERMISSION_DENIED", "The topic or service is not the robot's own"),
    ErrorRow("not_found", 404, "NOT_FOUND", "There is nothing at this path"),
    ErrorRow("unknown_robot", 404, "NOT_FOUND", "No such robot"),
    ErrorRow("unknown_recording", 404, "NOT_FOUND", "No such recording"),
    ErrorRow("unknown_command", 404, "NOT_FOUND", "No such command"),
    ErrorRow("unknown_topic", 404, "NOT_FOUND", "No such topic"),
    ErrorRow("unknown_node", 404, "NOT_FOUND", "No such node"),
    ErrorRow("unknown_template", 404, "NOT_FOUND", "No such template"),
    ErrorRow("unknown_revision", 404, "NOT_FOUND", "That revision is not kept"),
    ErrorRow("unknown_user", 404, "NOT_FOUND", "No such user"),
    ErrorRow("unknown_key", 404, "NOT_FOUND", "No such key"),
    ErrorRow("method_not_allowed", 405, "UNIMPLEMENTED", "This path does not take that method"),
    ErrorRow("request_timeout", 408, "DEADLINE_EXCEEDED", "The request's body did not come in time"),
    ErrorRow("duplicate", 409, "ALREADY_EXISTS", "The robot has seen this command before"),
    ErrorRow("idempotency_conflict", 409, "ALREADY_EXISTS", "The Idempotency-Key was used for another request"),
    ErrorRow("command_delivered", 409, "FAILED_PRECONDITION", "The command has left for its robot, or is over"),
    ErrorRow("stale", 409, "FAILED_PRECONDITION", "Too old to move the robot"),
    ErrorRow("interrupted", 409, "ABORTED", "The robot's agent ended while it ran: the outcome is not known"),
    ErrorRow("recording_not_stored", 409, "FAILED_PRECONDITION", "The recording has no file here, or not yet"),
    ErrorRow("bundle_invalid", 400, "INVALID_ARGUMENT", "The file is no bundle"),
    ErrorRow("unknown_update", 404, "NOT_FOUND", "No such update file"),
    ErrorRow("update_withdrawn", 410, "NOT_FOUND", "The version was withdrawn"),
    ErrorRow("update_refused", 409, "FAILED_PRECONDITION", "What was signed does not count"),
    ErrorRow("updates_not_set_up", 409, "FAILED_PRECONDITION", "No root of update files was published yet"),
    ErrorRow("unknown_rollout", 404, "NOT_FOUND", "No such rollout"),
    ErrorRow("rollout_state", 409, "FAILED_PRECONDITION", "The rollout is not in a state for that"),
    ErrorRow("user_exists", 409, "ALREADY_EXISTS", "There is a user of that name already"),
    ErrorRow("last_admin", 409, "FAILED_PRECONDITION", "Nobody could look after the gateway any more"),
    ErrorRow("lease_required", 409, "FAILED_PRECONDITION", "A valid teleop lease is required"),
    ErrorRow("lease_taken", 409, "FAILED_PRECONDITION", "Somebody else holds the teleop lease"),
    ErrorRow("type_hash_mismatch", 409, "FAILED_PRECONDITION", "The robot's type has the same name but other fields"),
    ErrorRow("twin_changed", 412, "FAILED_PRECONDITION", "Somebody else was faster: read it again"),
    ErrorRow("body_too_large", 413, "RESOURCE_EXHAUSTED", "The body is over its limit"),
    ErrorRow("too_large", 413, "RESOURCE_EXHAUSTED", "The message is over its limit"),
    ErrorRow("unsupported_media_type", 415, "INVALID_ARGUMENT", "Send application/json or application/cdr"),
    ErrorRow("busy", 429, "RESOURCE_EXHAUSTED", "The robot has too many commands under way"),
    ErrorRow("too_many", 429, "RESOURCE_EXHAUSTED", "A bounded table is full"),
    ErrorRow("too_many_requests", 429, "RESOURCE_EXHAUSTED", "Too often: come back later"),
    ErrorRow("purged", 410, "NOT_FOUND", "It is not stored any more"),
    ErrorRow("internal", 500, "INTERNAL", "The gateway failed"),
    ErrorRow("unsupported", 501, "UNIMPLEMENTED", "The robot's agent cannot do that"),
    ErrorRow("command_refused", 502, "FAILED_PRECONDITION", "The robot refused or failed the command"),
    ErrorRow("robot_offline", 503, "UNAVAILABLE", "The robot is offline"),
    ErrorRow("unavailable", 503, "UNAVAILABLE", "Nobody on the robot answers that"),
    ErrorRow("store_unavailable", 503, "UNAVAILABLE", "The store cannot do it now"),
    ErrorRow("objects_unavailable", 503, "UNAVAILABLE", "The object store cannot do it now"),
    ErrorRow("objects_refused", 503, "UNAVAILABLE", "The object store refuses the gateway"),
    ErrorRow("damaged", 500, "DATA_LOSS", "What was stored cannot be read"),
    ErrorRow("object_missing", 500, "DATA_LOSS", "A stored object is not there"),
    ErrorRow("object_corrupt", 500, "DATA_LOSS", "A stored object holds something else"),
    ErrorRow("provider_unavailable", 503, "UNAVAILABLE", "The identity provider cannot be asked"),
    ErrorRow("overloaded", 503, "UNAVAILABLE", "Too much is under way: try again"),
    ErrorRow("not_ready", 503, "UNAVAILABLE", "The gateway is not ready"),
    ErrorRow("expired", 504, "DEADLINE_EXCEEDED", "The command came too late and was not executed"),
    ErrorRow("timeout", 504, "DEADLINE_EXCEEDED", "No answer in time"),
    ErrorRow("csr_refused", 400, "INVALID_ARGUMENT", "The request for a certificate asks for more than a robot gets"),
    ErrorRow("token_unknown", 403, "PERMISSION_DENIED", "No such enrolment token"),
    ErrorRow("token_used", 403, "PERMISSION_DENIED", "The enrolment token was used before"),
    ErrorRow("token_expired", 403, "PERMISSION_DENIED", "The enrolment token is too old"),
    ErrorRow("token_foreign", 403, "PERMISSION_DENIED", "The enrolment token is for another fleet or robot"),
    ErrorRow("not_enrolled", 403, "UNAUTHENTICATED", "A robot of this name needs its certificate"),
    ErrorRow("certificate_foreign", 403, "UNAUTHENTICATED", "The certificate is not one of this fleet for this robot"),
    ErrorRow("certificate_expired", 403, "UNAUTHENTICATED", "The robot's certificate is too old"),
    ErrorRow("certificate_revoked", 403, "UNAUTHENTICATED", "The robot's identity was revoked"),
    ErrorRow("proof_refused", 403, "UNAUTHENTICATED", "The signature is not that of the certificate's key"),
    ErrorRow("clone_detected", 409, "ABORTED", "Two robots use one identity"),
    ErrorRow("ca_unavailable", 503, "UNAVAILABLE", "This gateway cannot issue certificates now"),
    ErrorRow("protocol", 400, "INVALID_ARGUMENT", "A frame breaks the link protocol"),
    ErrorRow("fenced", 409, "ABORTED", "A newer session of this robot is alive"),
)
