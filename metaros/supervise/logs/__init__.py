"""A process's output, kept in bounded files and read by page."""
