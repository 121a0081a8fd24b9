"""The bounds of functions, rules and the queue between them: rows of the one table in `metaros.limits`."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import dataclass
else:
    from metaros.limits.table import table as dataclass

__all__ = ["FunctionLimits"]

KIB = 1024
MIB = 1024 * KIB


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class FunctionLimits:
    """Bounds in bytes, counts and seconds; `metaros.limits.Limits` has them with all others."""

    pattern_bytes: int = 16 * KIB  # an event pattern as JSON
    pattern_depth: int = 16  # objects in objects of a pattern
    pattern_values: int = 1024  # fields and values that a pattern names
    rule_period_s: float = 366 * 86_400.0  # the longest time of a condition with a memory
    rule_rate: int = 1000  # events that such a condition counts to
    rule_group_paths: int = 4  # fields by which one keeps robots, or whatever they name, apart
    rules: int = 1000  # of one store; more are refused
    rule_bytes: int = 64 * KIB  # a rule's document as JSON
    rule_targets: int = 16  # targets of one rule
    rule_entries: int = 100  # changes of a rule that are kept
    rule_message_bytes: int = 256 * KIB  # a message that rules read; of a larger one they only learn which it is
    rule_decoded_bytes: int = 8 * MIB  # messages that rules read of one commit
    rule_payload_bytes: int = 256 * KIB  # what a rule gives to a target
    rule_states: int = 100_000  # groups that rules remember something of, in a gateway's memory
    rule_groups: int = 20_000  # groups of one rule; what is of further ones is not looked at, and counted as an error
    rule_catch_up: int = 100  # missed times of a schedule that are made up for
    rule_dry_rows: int = 200_000  # events and samples that a dry run looks at; then it is cut
    rule_dry_s: float = 20.0  # and for so long
    rule_dry_firings: int = 1000  # firings that a dry run tells in full
    hooks: int = 256  # endpoints for webhooks of others
    hook_bytes: int = 256 * KIB  # what comes in by one
    hook_skew_s: float = 300.0  # how far the time of a signed webhook may be off
    hook_requests_per_s: float = 50.0  # of one hook; in bursts of twice as many
    happening_entries: int = 100  # events of one request
    happenings_waiting: int = 4096  # that wait for their commit; more are refused
    aws_calls: int = 16  # of rules' targets at AWS at a time
    target_calls: int = 32  # deliveries of each other kind of target at a time
    target_s: float = 30.0  # the longest that one delivery of a rule to the outside may take
    function_minutes: int = 180  # of each function's counts that the gateway keeps
    invocations_waiting: int = 20_000  # calls of functions that wait for the database; further ones are only counted
    invocations_per_s: int = 100  # of one function that went well and are kept; failures all are, others are counted
    invocations_kept: int = 50_000  # of all functions; then the oldest go
    invocations_kept_s: float = 604_800.0  # and when they are so old
    function_log_lines: int = 2000  # of one function that a gateway has in memory
    function_log_bytes: int = 32 * MIB  # of all functions' together; then the oldest lines go
    function_log_streams: int = 32  # readers of live logs at a time
    function_drain_s: float = 5.0  # that calls of functions have when the gateway ends
    function_events_at_once: int = 64  # deliveries to functions that a gateway has under way
    function_events_each: int = 32  # and of one function's version or alias
    destinations_at_once: int = 16  # records of functions' ends that are on their way to others
    destination_s: float = 30.0  # the longest that one of them may take
    function_deploy_bytes: int = 16 * MIB  # of a JSON request that deploys a function; a zip file alone may be larger
    function_code_files: int = 5000  # that the view of a function's code lists
    function_code_text_bytes: int = 512 * KIB  # of one file that it shows
    mapping_batches: int = 16  # of one event source mapping under way at a time, each of another robot or topic
    mapping_batch_bytes: int = 4 * MIB  # of one batch's messages, as JSON; a larger message is a failure of its own
    mapping_cursors: int = 100_000  # streams of all event source mappings that are followed
    canaries: int = 256  # of all functions at a time
    queue_rows: int = 1_000_000  # that wait or are under way, of one store; more are refused
    queue_bytes: int = 1024 * MIB  # the same, with what belongs to them
    delivery_bytes: int = 6 * MIB + 64 * KIB  # one delivery's payload and context
    delivery_s: float = 14 * 86_400.0  # the longest that one is tried
    deliveries_at_once: int = 256  # under way in one gateway
    deliveries_at_once_bytes: int = 64 * MIB  # the same, with their payloads
    deliveries_of_target: int = 64  # of which one target has at most so many
    delivery_lease_s: float = 30.0  # after which what a silent gateway was working on is given to another
    delivery_losses: int = 32  # gateways that may die while they work on one; then it is dead
    delivery_batch_bytes: int = 16 * MIB  # that one transaction of the queue puts or leases
    accepts_waiting: int = 4096  # callers that wait for their deliveries to be stored; more are refused
    dead_letters: int = 100_000  # of one store, the newest
    dead_letters_bytes: int = 512 * MIB  # the same, with their payloads
    dead_letters_s: float = 14 * 86_400.0  # and for so long
    deduped: int = 1_000_000  # deliveries that are done and remembered, so that they are not put again
    dedup_s: float = 86_400.0  # and for so long
    happenings_kept: int = 1_000_000  # of one store, beside its journal of events, the newest
    happenings_bytes: int = 1024 * MIB  # the same
    happenings_s: float = 7 * 86_400.0  # and for so long: a replay reaches no further
    happening_bytes: int = 1 * MIB  # one event's data
    replay_per_s: int = 500  # events that a replay looks at
    replays_at_once: int = 4  # of one gateway; more are refused
    replays_kept: int = 100  # that ended, of one store
    functions: int = 1000  # of a gateway; more are refused
    function_versions: int = 1000  # of one function
    function_aliases: int = 256  # of one function
    function_layers: int = 5  # that one function uses
    function_layer_versions: int = 1000  # of all layers together
    function_mappings: int = 1000  # event source mappings of a gateway
    mapping_filters: int = 10  # patterns of one event source mapping
    function_tags: int = 50  # of one function or mapping
    function_policy_bytes: int = 20 * KIB  # of one policy, which is kept and shown
    function_environment_bytes: int = 4 * KIB  # of one function's variables, names and values
    function_zip_bytes: int = 50 * MIB  # of one zip file of code
    function_unpacked_bytes: int = 250 * MIB  # of a function's code and layers, unpacked
    function_codes_bytes: int = 10240 * MIB  # of all code that is kept, each zip file once
    function_cache_bytes: int = 4096 * MIB  # of code that a gateway has unpacked; the longest unused goes
    function_event_bytes: int = 1 * MIB  # of an event that waits in the queue
    function_files: int = 20_000  # files and folders of one zip file of code
    function_path_chars: int = 1024  # of the name of one of them
    function_launch_s: float = 10.0  # in which a worker's process is up and shut in
    function_uploads: int = 4  # requests with code that are on their way at a time
    lambda_request_bytes: int = 72 * MIB  # of a request with code to the Lambda API: 50 MiB in base64, and the rest
    lambda_skew_s: float = 300.0  # that a signature's time and the gateway's may differ
    lambda_link_s: float = 600.0  # that a link to a function's code is good
    function_payload_bytes: int = 6 * MIB  # of what a function is called with
    function_response_bytes: int = 6 * MIB + 100  # of what it returns at once, and of its error's document
    function_stream_bytes: int = 20 * MIB  # of a streamed answer; then it is broken off
    function_stream_burst_bytes: int = 6 * MIB  # of it that come as fast as they can
    function_stream_bytes_per_s: int = 2 * MIB  # and what comes after them
    function_stream_window_bytes: int = 1 * MIB  # of it that wait for their reader; then the function waits
    function_head_bytes: int = 1 * MIB + 128 * KIB  # of a worker's request: X-Ray causes are headers of up to 1 MiB
    function_connections: int = 8  # of a worker to its Runtime API
    function_init_s: float = 10.0  # from a worker's start to its first request for a call
    function_stop_s: float = 2.0  # that a worker has for its end before it is killed
    function_workers: int = 64  # worker processes of all functions of one engine
    function_waiting: int = 1024  # calls of one function that wait for a worker; more are throttled
    function_waiting_bytes: int = 64 * MIB  # the same of all functions together, in bytes
    function_wait_s: float = 10.0  # that a call waits for a worker; then it is throttled
    function_patience_s: float = 0.005  # that a call waits for a busy worker before another is started
    function_idle_s: float = 300.0  # that a worker without a call is kept
    function_calls: int = 100_000  # of one worker; then a fresh one takes its place
    function_call_log_bytes: int = 256 * KIB  # of one call's log; the rest of it is dropped, and said so
    function_log_bytes_per_s: int = 4 * MIB  # that are read of a worker's log; it waits where it writes more
    function_log_message_bytes: int = 64 * KIB  # of one message of a log; longer ones are cut
    function_tail_bytes: int = 4 * KIB  # of a call's log that come with its answer, the last
    function_watch_s: float = 0.25  # between two looks at a worker's memory and temporary files
    function_egress_connections: int = 64  # of a worker through its proxy; more are refused
    function_egress_all: int = 512  # the same of all workers together
    function_egress_head_bytes: int = 64 * KIB  # of a request to the proxy, and of an answer to a plain one
    function_egress_buffer_bytes: int = 128 * KIB  # that wait on one way of a connection; then no more are read of it
    function_egress_connect_s: float = 10.0  # for the request's head, and for name and connection
    function_egress_idle_s: float = 350.0  # that nothing goes over a connection; then it is closed
    function_egress_lookups: int = 8  # of names at a time, of all workers
    robot_triggers: int = 64  # of one function on a robot
    robot_events: int = 10_000  # of one function that wait on the robot's disk, its dead letters among them
    robot_events_bytes: int = 64 * MIB  # the same in bytes; further ones are counted and let go
    robot_dead_letters: int = 1000  # of one function on a robot; then the oldest go
    robot_results: int = 10_000  # of one function that wait for the agent; then the oldest go
    robot_result_bytes: int = 64 * KIB  # of what a handler returned that go into its result
    robot_heard_bytes: int = 16 * MIB  # of messages that were heard and not judged yet; further ones are dropped
    robot_groups: int = 1000  # that a trigger's condition remembers; then the longest unseen goes
    robot_actions: int = 32  # that one call of a handler asks of its robot
    robot_call_s: float = 30.0  # that a service has to answer a function
