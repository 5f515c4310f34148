"""What a run would have meant for the person in it: numbers in, findings out. No ROS and no engine.

`tables` loads what is published, `contact`, `separation` and `ergonomics` hold a run against it, `findings` says it,
`verdict` does all of it for a recording.
"""
