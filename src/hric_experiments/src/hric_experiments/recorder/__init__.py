"""Recording a live run into a run folder."""
