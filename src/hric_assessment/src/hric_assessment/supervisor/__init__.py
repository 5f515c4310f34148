"""Keeps a collaboration inside chosen limits while it runs: who is how near, and how fast the arm may then be.

An estimate of a model and a help in experiments: no certified safety function, and no protective stop.
"""
