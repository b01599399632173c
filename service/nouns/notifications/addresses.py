"""Where a webhook may go: names are resolved here, once, and the connection goes to the address
that was checked.

Without this a webhook would let anyone with a project reach what only this server can reach: its
own loopback, the laboratory's network, a cloud's metadata. An operator allows networks of their own
by `MODALBASE_WEBHOOK_NETWORKS`, and ports by `MODALBASE_WEBHOOK_PORTS`. What an IPv6 address
carries, as NAT64's does, must be allowed besides.

Networks that no public receiver is in: IANA's registries of special-purpose addresses, and what is
no unicast at all.

The registries are https://www.iana.org/assignments/iana-ipv4-special-registry and
…/iana-ipv6-special-registry. Their entries are here whether or not they are said to be globally
reachable, for those that are lead to relays and anycast servers. Python's `is_global` lacks
several, and differs between its versions.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from typing import TYPE_CHECKING

from service.platform.settings import Settings

if TYPE_CHECKING:
    import httpx

GLOBAL_UNICAST = IPv6Network("2000::/3")
"""All that IANA has opened of IPv6 for general use (RFC 4291)."""

SPECIAL = {
    ip_network(network): use
    for network, use in {
        "0.0.0.0/8": "this network",
        "10.0.0.0/8": "private",
        "100.64.0.0/10": "shared by a provider's customers",
        "127.0.0.0/8": "loopback",
        "169.254.0.0/16": "link-local",
        "172.16.0.0/12": "private",
        "192.0.0.0/24": "protocol assignments",
        "192.0.2.0/24": "documentation",
        "192.31.196.0/24": "AS112",
        "192.52.193.0/24": "multicast tunnels",
        "192.88.99.0/24": "6to4 relays",
        "192.168.0.0/16": "private",
        "192.175.48.0/24": "AS112",
        "198.18.0.0/15": "benchmarks",
        "198.51.100.0/24": "documentation",
        "203.0.113.0/24": "documentation",
        "224.0.0.0/4": "multicast",
        "240.0.0.0/4": "reserved, with broadcast",
        "::/128": "unspecified",
        "::1/128": "loopback",
        "::/96": "IPv4-compatible",
        "::ffff:0:0/96": "IPv4-mapped",
        "::ffff:0:0:0/96": "IPv4-translated",
        "64:ff9b::/96": "NAT64",
        "64:ff9b:1::/48": "local NAT64",
        "100::/64": "discard",
        "100:0:0:1::/64": "dummy prefix",
        "2001::/32": "Teredo",
        "2001::/23": "protocol assignments",
        "2001:db8::/32": "documentation",
        "2002::/16": "6to4",
        "2620:4f:8000::/48": "AS112",
        "3fff::/20": "documentation",
        "5f00::/16": "segment routing",
        "fc00::/7": "unique local",
        "fe80::/10": "link-local",
        "fec0::/10": "site-local",
        "ff00::/8": "multicast",
    }.items()
}
"""Each network with what it is for."""


def special_use(address: IPv4Address | IPv6Address) -> str | None:
    """What an address is for that is not of the public internet; None of one that is.

    >>> special_use(IPv4Address("192.0.0.192")), special_use(IPv4Address("1.1.1.1"))
    ('protocol assignments', None)
    """
    purpose = next((use for network, use in SPECIAL.items() if address in network), None)
    if purpose is None and address.version == 6 and address not in GLOBAL_UNICAST:
        return "not assigned"
    return purpose


# httpx is imported by the first URL: it would be a thirtieth of the start.

IpAddress = IPv4Address | IPv6Address
IpNetwork = IPv4Network | IPv6Network


class AddressError(Exception):
    """An address that no message may go to; the message says why."""


@dataclass(frozen=True)
class Target:
    """A URL with the address that its name stood for when it was checked."""

    url: httpx.URL  # as connected to: the address in place of the name
    host: str  # for the Host header
    name: str  # for TLS: the certificate must be of this name


def parse_url(url: str) -> httpx.URL:
    """A URL that a webhook may have, whatever its name stands for.

    Raises:
        AddressError: it is none.
    """
    import httpx

    try:
        parsed = httpx.URL(url)
    except httpx.InvalidURL as error:
        raise AddressError(f"is no URL: {error}") from None
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise AddressError("is no http:// or https:// URL with a host")
    if parsed.userinfo:
        raise AddressError("holds a user or password; the signature proves who sends")
    return parsed


def resolve(url: str, settings: Settings) -> Target:
    """The URL with its name resolved, where the operator allows it.

    Raises:
        AddressError: the port is not allowed, or the name stands for nothing, or for an address
            that is not public and not allowed.
    """
    parsed = parse_url(url)
    port = parsed.port or {"http": 80, "https": 443}[parsed.scheme]
    if not any(port in ports for ports in settings.allowed_ports):
        raise AddressError(
            f"goes to port {port}, which the operator does not allow (MODALBASE_WEBHOOK_PORTS)"
        )
    try:
        entries = socket.getaddrinfo(parsed.host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise AddressError(f"{parsed.host} cannot be resolved: {error}") from None
    addresses = [ip_address(str(entry[4][0]).split("%")[0]) for entry in entries]
    for address in addresses:
        if special := _special(address, settings.allowed_networks):
            raise AddressError(
                f"{parsed.host} leads to {special}, which is not a public address; an operator may"
                " allow its network (MODALBASE_WEBHOOK_NETWORKS)"
            )
    host = parsed.netloc.decode("ascii")
    return Target(parsed.copy_with(host=str(addresses[0]), port=port), host, parsed.host)


def _special(address: IpAddress, allowed: Sequence[IpNetwork]) -> str | None:
    """The address, or one that it carries, that is neither public nor allowed, with what it is for;
    None where all are.
    """
    use = special_use(address)
    if use is not None and not any(address in network for network in allowed):
        return f"{address} ({use})"
    return next(filter(None, (_special(inner, allowed) for inner in _carried(address))), None)


def _carried(address: IpAddress) -> list[IPv4Address]:
    """The IPv4 addresses that a form of IPv6 carries; a gateway or a tunnel would lead there."""
    # ::1 and :: are IPv6's own
    if isinstance(address, IPv4Address) or address.is_loopback or address.is_unspecified:
        return []
    if address.sixtofour is not None:
        return [address.sixtofour]
    if address.teredo is not None:
        return list(address.teredo)
    isatap = (int(address) >> 32) & 0xFDFFFFFF == 0x5EFE
    if isatap or any(address in network for network in _LAST_BITS):
        return [IPv4Address(int(address) & 0xFFFFFFFF)]
    return []


_LAST_BITS = tuple(map(IPv6Network, ("64:ff9b::/96", "::ffff:0:0/96", "::/96", "::ffff:0:0:0/96")))
"""NAT64 (RFC 6052), IPv4-mapped and IPv4-compatible (RFC 4291) and IPv4-translated (RFC 2765): an
IPv4 address is the last 32 bits.
"""
