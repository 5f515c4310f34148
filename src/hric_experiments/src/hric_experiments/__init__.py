"""Commands, live runs and the recorder."""
