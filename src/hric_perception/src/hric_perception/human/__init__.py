"""The emulated human: programs that move a hand, and the Motive that sees it."""

from hric_perception.human.hand import Hand
from hric_perception.human.motion_capture import Seen, see
from hric_perception.human.programs import Program, read_program

__all__ = ["Hand", "Program", "Seen", "read_program", "see"]
