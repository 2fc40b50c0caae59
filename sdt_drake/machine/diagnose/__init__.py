"""Diagnosis of recordings: each module returns `Finding` objects.

Read in this order: `finding`, `constants`, `recording`, `units`, `readings`, `residual`, `fit`.
"""
