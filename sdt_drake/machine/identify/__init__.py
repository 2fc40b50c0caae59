"""From recordings of a robot to its parameters, and how sure they are.

It knows robots, recordings and dynamics, and nothing of studies or pages.
"""
