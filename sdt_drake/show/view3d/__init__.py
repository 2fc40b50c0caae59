"""Robots and motions in 3D, in Meshcat."""
