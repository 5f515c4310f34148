"""Assessment of what a run would have meant for the person in it: numbers in, findings out; no ROS, no engine.

`tables` loads the published limits, `contact`, `separation` and `ergonomics` compare a run with them, `findings`
defines the results, and `verdict` assesses a complete recording.
"""
