"""Where large things are kept under a name: a directory, or an S3 bucket."""
