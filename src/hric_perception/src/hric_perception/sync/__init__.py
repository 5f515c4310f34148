"""Synchronisation of samples of many sources at their different rates."""
