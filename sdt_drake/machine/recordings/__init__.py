"""Recordings of robots, read from files with any columns and units into SI units, joint side."""
