"""Generated from proto/metaros/v1 by tools/gen_proto.py: do not edit."""
