"""Dossier of runs and sweeps: one folder with the evidence of simulation results, to be read without the code."""
