"""Execution of many runs: sweeps, studies, benchmark, approaches, limit speeds and stops."""
