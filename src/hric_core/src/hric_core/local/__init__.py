"""Framework without a master: nodes, topics, services and actions within one process."""
