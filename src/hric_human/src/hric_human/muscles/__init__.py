"""Muscles of a body, and what a task costs them."""
