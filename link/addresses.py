"""Addresses of ground stations: parsed, resolved and tried before a swarm starts."""

from __future__ import annotations

import ipaddress
import socket

__all__ = ["Address", "AddressError", "family_of", "is_loopback", "resolve"]

Address = tuple[str, int]
"""A numeric IPv4 or IPv6 address and a port."""


class AddressError(ValueError):
    """No datagram can be sent there; the text says why."""


def family_of(host: str) -> socket.AddressFamily:
    """The family of a numeric address."""
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def is_loopback(host: str) -> bool:
    """Whether a numeric address never leaves this machine."""
    return ipaddress.ip_address(host.partition("%")[0]).is_loopback


def _split(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    elif ":" in host:
        raise AddressError("an IPv6 address stands in brackets, such as [::1]:14550")
    if not host or host != host.strip():
        raise AddressError("must be HOST:PORT without blanks, such as 127.0.0.1:14550")
    if not (port.isascii() and port.isdigit() and len(port) < 6 and 0 < int(port) < 65536):
        raise AddressError("the port must be a number from 1 to 65535")
    return host, int(port)


def resolve(text: str) -> Address:
    """Parse HOST:PORT or [IPv6]:PORT, and resolve it to an address to which a datagram can be sent.

    Raises
    ------
    AddressError
        If it is no address, the host is unknown, it stands for no single host, or there is no route to it.
    """
    host, port = _split(text)
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise AddressError(f"no such host: {getattr(error, 'strerror', None) or error}") from None
    # IPv4 first: that is where ground stations listen for "localhost".
    family, _, _, _, place = min(found, key=lambda one: one[0] != socket.AF_INET)
    address = ipaddress.ip_address(str(place[0]).partition("%")[0])
    if address.is_multicast or address.is_unspecified or str(address) == "255.255.255.255":
        raise AddressError("must be the address of one host: no broadcast, no multicast")
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(place)
        except OSError as error:
            raise AddressError(f"cannot be reached: {error.strerror or error}") from None
    return str(place[0]), port
