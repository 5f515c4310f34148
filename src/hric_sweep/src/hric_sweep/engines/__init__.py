"""What carries the runs of a sweep out: processes of this machine, or a cluster."""
