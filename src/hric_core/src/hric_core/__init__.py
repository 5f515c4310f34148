"""Errors, parameters, geometry, robot descriptions, time, trial files and nodes, on which all packages stand."""
