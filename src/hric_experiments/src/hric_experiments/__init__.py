"""Experiment files, headless runner, run folders, recorder, metrics and figures."""
