"""Flights get better by being flown: what repeats of their errors is learned away."""
