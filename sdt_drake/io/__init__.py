"""Input and output: files, fields and their checks, tables, texts, progress."""
