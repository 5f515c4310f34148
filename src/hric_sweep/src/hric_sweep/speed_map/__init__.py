"""Limit speed of an arm for contacts with a person, over its workspace, found with a virtual measuring device."""
