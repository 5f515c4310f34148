"""Real person in front of a motion capture system: from labelled markers to joints and muscle load.

The muscle load also uses the force on the hand. The cores are `hric_motion.tracking` and `hric_motion.live_load`.
"""
