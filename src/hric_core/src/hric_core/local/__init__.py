"""The framework without a master: nodes, topics, services and actions within one process."""
