"""Joint angles and moments of a person from a trial (recorded measurement): command, files and page."""
