"""Readers of what a bag has on persons, contacts, objects and the safety supervisor, as arrays."""
