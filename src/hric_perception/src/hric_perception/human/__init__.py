"""Emulated human: the hand, moved by the programs of `hric_human.hand`, and the Motive that measures it."""

from hric_human.hand import Hand, Program, read_program
from hric_perception.human.motion_capture import CapturedHuman, see

__all__ = ["CapturedHuman", "Hand", "Program", "read_program", "see"]
