"""The command groups that a gateway adds to `metaros`: one module or package each."""
