"""One run: a scenario, its design, the closed loop, and the recording of its simulation."""
