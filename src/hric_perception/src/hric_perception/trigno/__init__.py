"""Delsys Trigno over TCP: a client of the vendor's server, and an emulated server."""

from hric_perception.trigno.client import TrignoClient
from hric_perception.trigno.server import TrignoServer

__all__ = ["TrignoClient", "TrignoServer"]
