"""MAVLink 2 as bytes: messages packed into datagrams, and read from them one by one; invalid ones are dropped.

The bare dialect class is used (not mavutil): a quarter of the import time and half of the memory.
"""

from __future__ import annotations

import collections
import math
import operator
from collections.abc import Callable, Collection
from typing import Any

from pymavlink.dialects.v20 import common as dialect

from ftcc.link.signing import Refusal, Signing

__all__ = ["Codec", "dialect"]

_SIGNATURE = 13
"""Bytes of a signature block: link, time stamp (6), signature (6)."""
_STAMP = slice(1, 7)
"""Where its time stamp stands."""
_MOST_REFUSALS = 64
_UNSIGNED = frozenset({dialect.MAVLINK_MSG_ID_HEARTBEAT})
"""Messages that are read without a signature."""


class _Parser(dialect.MAVLink):  # type: ignore[misc]
    """The dialect's parser and packer; it checks a signature before it uses its time stamp."""

    def __init__(self, system: int, component: int, signing: Signing | None) -> None:
        super().__init__(None, srcSystem=system, srcComponent=component)
        self.robust_parsing = True
        self.own_signing = signing
        self.refusal: Refusal | None = None
        """Why the last signature was not accepted."""
        if signing is not None:
            self.signing.secret_key = signing.key
            self.signing.link_id = signing.link
            self.signing.sign_outgoing = True
            self.signing.allow_unsigned_callback = lambda _, kind: kind in _UNSIGNED

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
        """The dialect's own method stores the stamp before it checks it: a forged one would shut a sender out."""
        assert self.own_signing is not None
        block = msgbuf[-_SIGNATURE:]
        if not self.own_signing.genuine(msgbuf):
            self.refusal = Refusal("other key", srcSystem, srcComponent)
        else:
            stream = (block[0], srcSystem, srcComponent)
            self.refusal = self.own_signing.accept(stream, int.from_bytes(block[_STAMP], "little"))
        return self.refusal is None


class Codec:
    """Packs and reads the messages of one sender on one link.

    Parameters
    ----------
    system, component : int
        Ids with which messages are sent.
    signing : Signing, optional
        With it messages are signed; unsigned ones, except HEARTBEAT, and repeated ones are dropped.
    lenient : collection of str
        Further messages that may hold nan or inf: their readers check what they use.
    """

    def __init__(
        self, system: int, component: int, signing: Signing | None = None, lenient: Collection[str] = ()
    ) -> None:
        self._mav = _Parser(system, component, signing)
        self._signing = signing
        self._lenient = lenient
        self.bad_data = 0
        """Pieces of datagrams that were not valid MAVLink."""
        self.not_finite = 0
        """Messages dropped because a float in them was nan or inf."""
        self.not_signed: collections.Counter[str] = collections.Counter()
        """Messages dropped because of their signature, by `Reason`."""
        self._refusals: list[Refusal] = []

    def pack(self, *messages: Any, sequence: int | None = None) -> bytes:
        """``messages`` as one datagram, numbered from ``sequence`` on, or from where the last one ended.

        Raises
        ------
        ValueError
            If a float in one of them is nan, inf or beyond float32: such a value would be believed on the other side.
        """
        datagram = bytearray()
        if sequence is not None:
            self._mav.seq = sequence
        for message in messages:
            if not _finite(message):
                raise ValueError(f"{message.get_type()} holds a value that is not finite: {message}")
            if self._signing is not None:
                self._mav.signing.timestamp = self._signing.stamp()
            try:
                datagram += message.pack(self._mav)
            except OverflowError as error:
                raise ValueError(f"{message.get_type()} holds a value that float32 cannot: {message}") from error
            self._mav.seq = (self._mav.seq + 1) % 256
        return bytes(datagram)

    def parse(self, datagram: bytes) -> list[Any]:
        """The messages of a datagram, in order; bad data and non-finite values are dropped and counted."""
        messages: list[Any] = []
        try:
            for message in self._mav.parse_buffer(datagram) or ():
                if message.get_msgId() < 0:
                    if getattr(message, "reason", "") == "Invalid signature":
                        self._refuse(message.data)
                    else:
                        self.bad_data += 1
                elif _finite(message) or message.get_type() in self._lenient:
                    messages.append(message)
                else:
                    self.not_finite += 1
        finally:
            self._forget()
        return messages

    def _refuse(self, frame: bytearray) -> None:
        second = frame[0] == dialect.PROTOCOL_MARKER_V2
        refusal = self._mav.refusal
        if refusal is None or not (second and frame[2] & dialect.MAVLINK_IFLAG_SIGNED):
            at = 5 if second else 3
            refusal = Refusal("unsigned", frame[at], frame[at + 1])
        self.not_signed[refusal.reason] += 1
        if len(self._refusals) < _MOST_REFUSALS:
            self._refusals.append(refusal)

    def take_refusals(self) -> list[Refusal]:
        """Return the messages dropped because of their signature since the last call; of very many the first ones."""
        refusals, self._refusals = self._refusals, []
        return refusals

    def _forget(self) -> None:
        """Reset the parser: after a forged header it would take the next good datagrams for its payload."""
        if self._mav.buf_len() > 0:
            self.bad_data += 1
        self._mav.buf = bytearray()
        self._mav.buf_index = 0
        self._mav.expected_length = dialect.HEADER_LEN_V1 + 2
        self._mav.have_prefix_error = False


_MAY_HOLD_NAN = ("COMMAND_LONG", "COMMAND_INT", "PARAM_SET", "PARAM_VALUE")
"""Here nan means "not given", or is the bit pattern of an integer: the readers check what they use."""

_sum_floats: dict[int, Callable[[Any], float]] = {}


def _adder(message: Any) -> Callable[[Any], float]:
    """A function that sums all floats of such a message: the sum is finite only if every term is."""
    kinds = zip(message.fieldnames, message.fieldtypes, strict=True)
    names = [name for name, kind in kinds if kind in ("float", "double")]
    if message.get_type() in _MAY_HOLD_NAN:
        names = []
    arrays = [name for name in names if not isinstance(getattr(message, name), float | int)]
    scalars = [name for name in names if name not in arrays]
    # An attrgetter of one name gives the value itself: the second name makes it a tuple.
    read_scalars = operator.attrgetter(*(scalars * 2)) if scalars else lambda _: ()
    read_arrays = operator.attrgetter(*(arrays * 2)) if arrays else lambda _: ()
    return lambda one: sum(read_scalars(one)) + sum(map(sum, read_arrays(one)))


def _finite(message: Any) -> bool:
    kind = message.get_msgId()
    add = _sum_floats.get(kind)
    if add is None:
        add = _sum_floats[kind] = _adder(message)
    return math.isfinite(add(message))
