"""AWS Lambda's own API on `/lambda`: unmodified boto3, the `aws` command line and other SDKs manage and call functions.

`signed` finds out who asks, `routes` does what is asked, `shaped` gives every refusal the form that these clients know.
"""

from __future__ import annotations
