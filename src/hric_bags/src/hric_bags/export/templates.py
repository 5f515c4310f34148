"""Anonymisation of messages without decoding them, by the example of a message of the same type that was decoded.

If all strings and array lengths of a message equal those of the example, its fields are at the same bytes.
"""

import re
from collections.abc import Callable
from struct import Struct
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from hric_bags.export.gather import TIMES

NO_DATE = {
    "float64": rb".{6}(?![\xcd-\xed]A)..",
    "float32": rb"...[^NO]",
    "int64": rb".{7}[\0\x80-\xff]",
    "uint64": rb".{7}\0",
}
"""Type of a number -> regular expression for the bytes of numbers that are certainly no dates.

Dates are numbers from 1e9 to 4e9 [s], or from 2**56 [ns] on. Numbers of other types are never dates, nor are those in
arrays of other types than float64.
"""
_STAMP, _LENGTH = Struct("<iI"), Struct("<I")


class Template:
    """Pattern of messages of one type that differ only in numbers and stamps, made from one of them.

    Args:
        store: definitions of the message types.
        kind: message type.
        message: one of the messages, as recorded.
        text: function from the name of a field and its text to the anonymised text.
        exact: function that returns True for fields whose numbers must equal those of `message`.
    """

    def __init__(
        self,
        store: Typestore,
        kind: str,
        message: Any,
        text: Callable[[str, str], str],
        exact: Callable[[str], bool],
    ) -> None:
        self._store, self._text, self._exact = store, text, exact
        self._size = 0
        self._parts: list[bytes] = []
        self._edits: list[tuple[int, int, bytes]] = []
        """(begin, end, replacement) of bytes in a message; for stamps b"", since their replacement is computed."""
        self._walk("", Nodetype.NAME, kind, message)
        self._pattern = re.compile(b"".join(self._parts), re.DOTALL)

    def cleaned(self, raw: bytes, time: Callable[[int], int], first_second: int) -> bytes | None:
        """Return a serialised message anonymised; None: this template does not apply to it.

        A template does not apply if a text or length differs, or if a number that is no stamp may be a date (a time of
        the calendar).

        Args:
            raw: serialised message.
            time: function from a date [ns] to the time that is exported [ns].
            first_second: smallest stamp that counts as a date [s].
        """
        if self._pattern.fullmatch(raw) is None:
            return None
        parts: list[bytes] = []
        at = 0
        for begin, end, put in self._edits:
            if not put:
                seconds, rest = _STAMP.unpack_from(raw, begin)
                if seconds < first_second:
                    continue
                put = _STAMP.pack(*divmod(time(seconds * 1_000_000_000 + rest), 1_000_000_000))
            parts += raw[at:begin], put
            at = end
        return b"".join((*parts, raw[at:])) if parts else raw

    def _walk(self, field: str, node: Nodetype, about: Any, value: Any) -> None:
        """Add the pattern of a field's value; node, about: type of the value, as rosbags describes it."""
        if node == Nodetype.NAME and about not in TIMES:
            for name, (inner, of) in self._store.fielddefs[about][1]:
                self._walk(name, inner, of, getattr(value, name))
        elif node == Nodetype.NAME:
            self._edits.append((self._size, self._size + _STAMP.size, b""))
            self._add(b".{8}", _STAMP.size)
        elif node == Nodetype.BASE and about[0] == "string":
            self._add_text(value, self._text(field, value))
        elif node == Nodetype.BASE:
            size = np.dtype({"char": "uint8"}.get(about[0], about[0])).itemsize
            self._add(NO_DATE.get(about[0], b".{%d}" % size), size)
        else:
            if node == Nodetype.SEQUENCE:
                self._add(re.escape(_LENGTH.pack(len(value))), _LENGTH.size)
            if not isinstance(value, np.ndarray):
                inner, of = about[0]
                for item in value:
                    self._walk(field, inner, of, item)
            elif self._exact(field):
                self._add(re.escape(value.tobytes()), value.nbytes)
            elif value.dtype == np.float64:
                self._add(b"(?:%b){%d}" % (NO_DATE["float64"], len(value)), value.nbytes)
            else:
                self._add(b".{%d}" % value.nbytes, value.nbytes)

    def _add_text(self, text: str, passed: str) -> None:
        original, put = (_LENGTH.pack(len(part)) + part for part in (text.encode(), passed.encode()))
        if put != original:
            self._edits.append((self._size, self._size + len(original), put))
        self._add(re.escape(original), len(original))

    def _add(self, pattern: bytes, size: int) -> None:
        self._parts.append(pattern)
        self._size += size
