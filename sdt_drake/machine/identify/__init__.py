"""Identification: a robot's parameters and their uncertainty, estimated from recordings.

This package depends on robots, recordings and dynamics, not on studies or reports.
"""
