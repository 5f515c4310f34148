"""Many approaches of a person to a working arm, drawn at random: does a supervisor hold what it says?"""
