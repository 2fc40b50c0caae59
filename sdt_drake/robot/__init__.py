"""The robot: its file, dynamics, drives and motors."""
