"""Map of an arm's limit speed for contacts with a person over its workspace, from simulated impact measurements."""
