"""Iterative learning control: reduce the repeating part of the error from flight to flight."""
