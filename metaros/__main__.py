"""`python -m metaros …` is `metaros …`."""

from __future__ import annotations

if __name__ == "__main__":
    from metaros.cli.main import main

    main()
