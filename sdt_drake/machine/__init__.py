"""The real machine: recordings, identification, learning, replay, drive files."""
