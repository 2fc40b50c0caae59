"""Motions of a device that are felt like a recorded flight.

Read in this order: `flight`, `problem`, `felt`, `alignment`, `riccati`, `program`, `search`,
`candidate`, `procedure`.
"""
