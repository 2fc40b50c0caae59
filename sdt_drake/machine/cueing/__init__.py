"""Motions of a device that reproduce a recorded flight.

Read in this order: `flight`, `alignment`, `program`, `candidate`, `procedure`.
"""
