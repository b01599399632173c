"""Where a webhook may go: names are resolved here, once, and the connection goes to the address that was checked.

Without this a webhook would let anyone with a project reach what only this server can reach: its own loopback, the
laboratory's network, a cloud's metadata. An operator allows networks of their own by `MODALBASE_WEBHOOK_NETWORKS`.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Sequence
from dataclasses import dataclass

import httpx

IpAddress = ipaddress.IPv4Address | ipaddress.IPv6Address
IpNetwork = ipaddress.IPv4Network | ipaddress.IPv6Network


class AddressError(Exception):
    """A URL that no message may go to; the message says why."""


@dataclass(frozen=True)
class Target:
    """A URL with the address that its name stood for when it was checked.

    Attributes:
        url: as connected to: the address in place of the name.
        host: for the Host header.
        name: for TLS: the certificate must be of this name.
    """

    url: httpx.URL
    host: str
    name: str


def parse_url(url: str) -> httpx.URL:
    """A URL that a webhook may have, whatever its name stands for.

    Raises:
        AddressError: it is none.
    """
    try:
        parsed = httpx.URL(url)
    except httpx.InvalidURL as error:
        raise AddressError(f"is no URL: {error}") from None
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise AddressError("is no http:// or https:// URL with a host")
    if parsed.userinfo:
        raise AddressError("holds a user or password; the signature proves who sends")
    return parsed


def resolve(url: str, allowed: Sequence[IpNetwork]) -> Target:
    """The URL with its name resolved.

    Raises:
        AddressError: the name stands for nothing, or for an address that is not public and not allowed.
    """
    parsed = parse_url(url)
    port = parsed.port or {"http": 80, "https": 443}[parsed.scheme]
    try:
        found = socket.getaddrinfo(parsed.host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise AddressError(f"{parsed.host} cannot be resolved: {error}") from None
    addresses = [ipaddress.ip_address(str(entry[4][0]).split("%")[0]) for entry in found]
    for address in addresses:
        if not _permitted(address, allowed):
            raise AddressError(
                f"{parsed.host} is {address}, which is not a public address; an operator may allow its network "
                "(MODALBASE_WEBHOOK_NETWORKS)"
            )
    host = parsed.netloc.decode("ascii")
    return Target(parsed.copy_with(host=str(addresses[0]), port=port), host, parsed.host)


def _permitted(address: IpAddress, allowed: Sequence[IpNetwork]) -> bool:
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped
    return (address.is_global and not address.is_multicast) or any(address in network for network in allowed)
