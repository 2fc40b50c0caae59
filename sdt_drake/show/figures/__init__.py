"""Figures of runs, motions, the pilot and studies, by matplotlib."""
