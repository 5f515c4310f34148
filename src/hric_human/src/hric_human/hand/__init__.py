"""Motion programs of a human hand, and the hand that runs one; without ROS.

hand = Hand(read_program({"program": "sinusoid", "cycles": 2}, seed=0))
hand.start(1.0)
pose = hand(1.5)
"""

from hric_human.hand.program import Hand, Program
from hric_human.hand.programs import PROGRAMS, Motion, program_of, read_program

__all__ = ["PROGRAMS", "Hand", "Motion", "Program", "program_of", "read_program"]
