"""Online supervision of a collaboration: measures the person's distance and limits the arm's speed accordingly.

It is an estimate of a model and an aid for experiments: no certified safety function, and no protective stop.
"""
