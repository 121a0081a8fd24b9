"""Why an update was not made. What ran before still runs; every leaf has a stable `code` for the gateway.

UpdateError
├── UpdateFetchError       the gateway does not give it; tried again          update_fetch
│   ├── UpdateSlowError    it comes too slowly                                update_slow
│   └── UpdateTooLargeError   more comes than was signed, or may come         update_too_large
├── UpdateUnsignedError    not enough signatures of the right keys            update_unsigned
├── UpdateRollbackError    signed files older than those seen before          update_rollback
├── UpdateExpiredError     signed files whose time is over                    update_expired
├── UpdateMismatchError    other bytes than were signed                       update_mismatch
├── UpdateMetadataError    signed files that do not fit together              update_metadata
├── UpdateUnknownError     no such version is signed for this robot           update_unknown
├── UpdateFloorError       a version below the minimum                        update_floor
├── UpdateForeignError     for another machine, Python or name                update_foreign
├── UpdateInstallError     its wheels cannot be installed                     update_install
├── UpdateUnhealthyError   it ran, and was taken back                         update_unhealthy
├── UpdateOffError         this robot takes no updates                        update_off
└── SlotError              the slots cannot be read or written                slot
"""

from __future__ import annotations

from metaros.errors import MetarosError

__all__ = [
    "SlotError",
    "UpdateError",
    "UpdateExpiredError",
    "UpdateFetchError",
    "UpdateFloorError",
    "UpdateForeignError",
    "UpdateInstallError",
    "UpdateMetadataError",
    "UpdateMismatchError",
    "UpdateOffError",
    "UpdateRollbackError",
    "UpdateSlowError",
    "UpdateTooLargeError",
    "UpdateUnhealthyError",
    "UpdateUnknownError",
    "UpdateUnsignedError",
]


class UpdateError(MetarosError):
    """An update was not made; what ran before still runs."""

    code = "update"


class UpdateFetchError(UpdateError):
    """The gateway does not give a signed file, or not all of it."""

    code = "update_fetch"


class UpdateSlowError(UpdateFetchError):
    """A signed file comes more slowly than any useful link is."""

    code = "update_slow"


class UpdateTooLargeError(UpdateFetchError):
    """More bytes come than were signed, or than may come."""

    code = "update_too_large"


class UpdateUnsignedError(UpdateError):
    """A file is not signed by enough of the keys that may sign it."""

    code = "update_unsigned"


class UpdateRollbackError(UpdateError):
    """Signed files are older than, or other than, what this robot has seen before."""

    code = "update_rollback"


class UpdateExpiredError(UpdateError):
    """The time of signed files is over: nobody has vouched for them lately."""

    code = "update_expired"


class UpdateMismatchError(UpdateError):
    """A file has another length or hash than the one that was signed."""

    code = "update_mismatch"


class UpdateMetadataError(UpdateError):
    """Signed files are malformed, or do not fit together."""

    code = "update_metadata"


class UpdateUnknownError(UpdateError):
    """No such version is signed for this robot."""

    code = "update_unknown"


class UpdateFloorError(UpdateError):
    """The version is below the least one that may ever be installed again."""

    code = "update_floor"


class UpdateForeignError(UpdateError):
    """The bundle is for another machine, another Python, or is another bundle than its path says."""

    code = "update_foreign"


class UpdateInstallError(UpdateError):
    """The bundle's wheels cannot be installed."""

    code = "update_install"


class UpdateUnhealthyError(UpdateError):
    """The new version ran, did not do well, and was taken back."""

    code = "update_unhealthy"


class UpdateOffError(UpdateError):
    """This robot takes no updates: it is not enrolled, or its agent was started without the loader."""

    code = "update_off"


class SlotError(UpdateError):
    """The slots on the disk cannot be read or written."""

    code = "slot"
