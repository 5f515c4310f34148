"""Motions of an arm from data sets of others, replayed as experiments."""
