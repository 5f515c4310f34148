"""The emulated human: programs that move a hand, and the Motive that sees it."""

from hric_perception.human.hand import Hand, Program
from hric_perception.human.motion_capture import CapturedHuman, see
from hric_perception.human.programs import read_program

__all__ = ["CapturedHuman", "Hand", "Program", "read_program", "see"]
