"""Studies: many variants of a scenario, run by many processes, and their statistics."""
