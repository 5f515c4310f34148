"""Dossier of runs and sweeps: one folder that documents simulation results for readers without this software."""
