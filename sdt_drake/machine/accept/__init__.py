"""The acceptance test of a device: its motions, characteristics, limits and prediction."""
