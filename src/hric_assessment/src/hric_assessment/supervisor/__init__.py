"""Online supervision of a collaboration: distances of the person, and the speed that the arm may have.

An estimate of a model and a help in experiments: no certified safety function, and no protective stop.
"""
