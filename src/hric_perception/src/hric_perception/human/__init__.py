"""Emulated human: a hand, moved by a program of `hric_human.hand`, and an emulated Motive (OptiTrack) measuring it."""

from hric_human.hand import Hand, Program, read_program
from hric_perception.human.motion_capture import CapturedHuman, see

__all__ = ["CapturedHuman", "Hand", "Program", "read_program", "see"]
