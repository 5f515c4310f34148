"""Assessment of a recorded run for the person in it: safety of contacts and distance, and ergonomics. No ROS.

`tables` loads the published limits; `contact`, `separation` and `ergonomics` compare a run with them; `findings`
defines the results; `verdict` assesses a complete recording; `supervisor` watches the separation while an arm moves.
"""
