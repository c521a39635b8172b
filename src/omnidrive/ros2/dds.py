"""Access to Cyclone DDS: the package, domains with unicast peers, types and QoS."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from ipaddress import ip_address
from socket import AF_INET, getaddrinfo
from typing import Any
from xml.sax.saxutils import quoteattr

from omnidrive.errors import InvalidInput, MissingExtra, one_line, short_repr
from omnidrive.ros2.interface import LATEST, PRIMITIVES, Distribution, Field, interface
from omnidrive.ros2.names import dds_type_name
from omnidrive.ros2.qos import Qos
from omnidrive.ros2.type_hash import NO_FIELDS, type_hash

MAX_DOMAIN = 232
"""Greatest number of a domain whose ports exist."""


def cyclonedds(module: str) -> Any:
    """Return a module of the package cyclonedds.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return import_module(f"cyclonedds.{module}")
    except ModuleNotFoundError:
        raise MissingExtra(
            "ROS 2 needs the package cyclonedds: pip install 'cyclonedds>=11.0'"
        ) from None


def dds_qos(qos: Qos, user_data: bytes) -> Any:
    """Return the QoS of an endpoint as ROS 2 middlewares set it.

    Args:
        qos: Quality of service.
        user_data: USER_DATA of the endpoint.
    """
    policy = cyclonedds("core").Policy
    history = policy.History.KeepLast(qos.depth) if qos.depth else policy.History.KeepAll
    forever = 2**63 - 1
    policies = [
        policy.Reliability.Reliable(forever) if qos.reliable else policy.Reliability.BestEffort,
        policy.Durability.TransientLocal if qos.transient_local else policy.Durability.Volatile,
        history,
        policy.WriterDataLifecycle(autodispose=False),
        policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        policy.Userdata(user_data),
    ]
    if qos.transient_local:
        policies.append(policy.DurabilityService(0, history, -1, -1, -1))
    return cyclonedds("core").Qos(*policies)


def user_data(qos: Any) -> dict[str, str]:
    """Return the entries of USER_DATA, ``key=value;`` each, of a discovered entity."""
    policy = cyclonedds("core").Policy
    data: bytes = qos[policy.Userdata].data if policy.Userdata in qos else b""
    text = data[:4096].decode("utf-8", "replace")
    return dict(part.split("=", 1) for part in text.split(";") if "=" in part)


def endpoint_data(name: str, distribution: Distribution, identity: str = "") -> bytes:
    """Return USER_DATA of an endpoint: from Iron on the hash of its type."""
    mark = "" if distribution == "humble" else f"typehash={type_hash(name, distribution)};"
    return (identity + mark).encode()


class Raw:
    """A message as bytes, as the readers and writers of a :func:`dds_type` take it."""

    data: bytes
    sample_info: Any


@cache
def dds_type(name: str, distribution: Distribution = LATEST, *, request: bool = False) -> Any:
    """Return the DDS type of an interface, whose samples are :class:`Raw` bytes.

    Args:
        name: Full name of the interface.
        distribution: Distribution whose definition holds.
        request: Whether it begins with the identity of a request, as rmw_cyclonedds sends it.
    """
    types = cyclonedds("idl.types")
    head = {"request_writer": types.uint64, "request_number": types.int64} if request else {}
    made = _struct(name, distribution, head)

    def begin(self: Any, data: bytes) -> None:
        """Keep the encoded message."""
        self.data = data

    made.__init__ = begin
    made.serialize = lambda self, **_: self.data
    made.deserialize = classmethod(lambda cls, data, **_: cls(data))
    made.deserialize_key = made.deserialize  # of a publisher that leaves
    return made


@cache
def _nested(name: str, distribution: Distribution) -> Any:
    return _struct(name, distribution, {})


def _struct(name: str, distribution: Distribution, head: dict[str, Any]) -> Any:
    fields = dict(head)
    for each in interface(name, distribution).fields or (NO_FIELDS,):
        fields[each.name] = _member(each, distribution)
    dotted = dds_type_name(name).replace("::", ".")
    make = cyclonedds("idl").make_idl_struct
    return make(dotted.rpartition(".")[2], dotted, fields, dataclassify=False)


def _member(field: Field, distribution: Distribution) -> Any:
    types = cyclonedds("idl.types")
    if field.type in PRIMITIVES:
        one = bool if field.type == "bool" else getattr(types, field.type)
    elif field.type == "string":
        one = types.bounded_str[field.bound] if field.bound else str
    else:
        one = _nested(field.type, distribution)
    if field.kind == "array":
        return types.array[one, field.length]
    if field.kind == "sequence":
        return types.sequence[one, field.length] if field.length else types.sequence[one]
    return one


def domain_number(domain: int | None) -> int:
    """Return the number of a domain; None: that of ROS_DOMAIN_ID, or 0.

    Raises:
        InvalidInput: It is not a whole number from 0 to 232.
    """
    given = os.environ.get("ROS_DOMAIN_ID") or "0" if domain is None else str(domain)
    if not (given.isdecimal() and given.isascii() and int(given[:9]) <= MAX_DOMAIN):
        source = "ROS_DOMAIN_ID" if domain is None else "the domain"
        raise InvalidInput(
            f"{source} is {short_repr(given)}, need a whole number from 0 to {MAX_DOMAIN}"
        )
    return int(given)


_domains: dict[int, tuple[tuple[str, ...], Any]] = {}
"""Domains that were configured in this process."""


def join_domain(domain: int, peers: Sequence[str]) -> None:
    """Configure a domain of this process with unicast peers; without peers as the network has it.

    Args:
        domain: Number of the domain.
        peers: IPv4 addresses or names of hosts; instead of those that CYCLONEDDS_URI configures.

    Raises:
        InvalidInput: The domain is in use with other peers, or an address is not usable.
    """
    wanted = tuple(peers)
    if domain in _domains:
        if _domains[domain][0] != wanted:
            raise InvalidInput(
                f"domain {domain} is in use in this process with other peers; use the same ones"
            )
        return
    held = None
    for peer in wanted:
        _check_host(peer)
    if wanted:
        errors = cyclonedds("core").DDSException
        try:
            held = cyclonedds("domain").Domain(domain, _configuration(wanted))
        except (errors, UnicodeError) as error:
            raise InvalidInput(
                f"domain {domain} cannot be joined with the peers {', '.join(wanted)}: {error}"
            ) from None
    _domains[domain] = wanted, held


def _configuration(peers: tuple[str, ...]) -> str:
    """Return the configuration of a domain; with peers on this host only, without multicast."""
    local = all(map(_is_loopback, peers))
    general = (
        '<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
        "<AllowMulticast>false</AllowMulticast>"
    )
    listed = "".join(f"<Peer Address={quoteattr(peer)}/>" for peer in peers)
    return (
        f"<CycloneDDS><Domain><General>{general if local else ''}</General>"
        "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        f"<Peers>{listed}</Peers></Discovery></Domain></CycloneDDS>"
    )


def _check_host(peer: str) -> None:
    """Raise InvalidInput if a host is unknown: Cyclone DDS aborts the process then."""
    try:
        getaddrinfo(peer, None, AF_INET)
    except (OSError, UnicodeError) as error:
        reason = one_line(str(getattr(error, "strerror", None) or error)).lower()
        raise InvalidInput(
            f"the peer {short_repr(peer, 80)} is an unknown host ({reason}): give a name or an "
            "IPv4 address, without a port"
        ) from None


def _is_loopback(peer: str) -> bool:
    try:
        return ip_address(peer).is_loopback
    except ValueError:
        return peer == "localhost"
