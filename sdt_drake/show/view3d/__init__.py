"""The device in 3D, in Meshcat."""
