"""Real person in front of a motion capture system: from labelled markers to joints and muscle load.

The muscle load also uses the force on the hand. The cores are `hric_human.tracking` and `hric_human.muscles.live_load`.
"""
