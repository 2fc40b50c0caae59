"""The robot: its file, dynamics, drives, motors, and the pilot's head on it."""
