"""Contacts of a person with a robot held against what he bears."""
