"""Exit code 0 when the gateway of this container says that it is ready: `python healthcheck.py [PORT]`.

It asks by http, and by https where that is what the port speaks. Its own loopback is not verified: nothing is sent, and
nothing is believed but a yes or no.
"""

from __future__ import annotations

import ssl
import sys
import urllib.error
import urllib.request

TIMEOUT_S = 4.0


def main(arguments: list[str]) -> int:
    """0: ready; 1: not, and why."""
    port = int(arguments[0]) if arguments else 8080
    unverified = ssl.create_default_context()
    unverified.check_hostname, unverified.verify_mode = False, ssl.CERT_NONE
    said = ""
    for scheme in ("http", "https"):
        try:
            urllib.request.urlopen(f"{scheme}://127.0.0.1:{port}/readyz", timeout=TIMEOUT_S, context=unverified)
        except urllib.error.HTTPError as error:  # of plain http at a port with TLS, too
            said = f"{error.code} {error.read(500).decode(errors='replace')}"
        except OSError as error:
            said = said or str(error)
        else:
            return 0
    print(said, file=sys.stderr)
    return 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
