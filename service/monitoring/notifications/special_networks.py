"""Networks that no public receiver is in: IANA's registries of special-purpose addresses, and what is no unicast at all.

The registries are https://www.iana.org/assignments/iana-ipv4-special-registry and …/iana-ipv6-special-registry. Their entries
are here whether or not they are said to be globally reachable, for those that are lead to relays and anycast servers.
Python's `is_global` lacks several, and differs between its versions.
"""

from __future__ import annotations

from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_network

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
    found = next((use for network, use in SPECIAL.items() if address in network), None)
    if found is None and address.version == 6 and address not in GLOBAL_UNICAST:
        return "not assigned"
    return found
