"""Quality of service of publishers and subscriptions, and which pairs of them match."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Any, Literal, NamedTuple, get_args

Durability = Literal["volatile", "transient local", "transient", "persistent"]
Liveliness = Literal["automatic", "manual by participant", "manual by topic"]
DestinationOrder = Literal["by reception timestamp", "by source timestamp"]
Access = Literal["instance", "topic", "group"]
_FOREVER = 2**63 - 1  # ns


class Qos(NamedTuple):
    """Quality of service of a publisher or subscription; the default is that of ROS 2."""

    reliable: bool = True
    """Whether lost messages are sent again."""
    durability: Durability = "volatile"
    """``volatile``, or else subscriptions that join later receive the last messages."""
    depth: int = 10
    """Number of messages kept; 0: all."""
    deadline: float = inf
    """Longest time between messages, s."""
    liveliness: Liveliness = "automatic"
    """What shows that a publisher is alive."""
    lease: float = inf
    """Longest time between signs of life, s."""
    exclusive: bool = False
    """Whether only the strongest publisher reaches a subscription."""
    order: DestinationOrder = "by reception timestamp"
    """Order of the messages of several publishers."""
    access: Access = "instance"
    """What coherent changes and order refer to."""
    coherent: bool = False
    """Whether changes are received together."""
    ordered: bool = False
    """Whether changes are received in the order of sending."""
    latency: float = 0.0
    """Time by which messages may be delayed, s."""

    @property
    def transient_local(self) -> bool:
        """Whether subscriptions that join later receive the last messages."""
        return self.durability != "volatile"

    def fault(self, offered: Qos) -> str | None:
        """Return why a subscription with these demands gets nothing; None: it is compatible.

        The rules are those of requested and offered policies (OMG, "Data Distribution Service",
        version 1.4, section 2.2.3).

        Args:
            offered: What the publisher offers.
        """
        return "; ".join(self._faults(offered)) or None

    def _faults(self, offered: Qos) -> Iterator[str]:
        """Yield the policies that are not compatible."""
        reliability = ("best effort", "reliable")
        ranks: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
            (
                "reliability",
                reliability[self.reliable],
                reliability[offered.reliable],
                reliability,
            ),
            ("durability", self.durability, offered.durability, get_args(Durability)),
            ("liveliness", self.liveliness, offered.liveliness, get_args(Liveliness)),
            ("destination order", self.order, offered.order, get_args(DestinationOrder)),
            ("presentation", self.access, offered.access, get_args(Access)),
            *(
                (f"presentation {name}", str(wanted), str(given), ("False", "True"))
                for name, wanted, given in (
                    ("coherent", self.coherent, offered.coherent),
                    ("ordered", self.ordered, offered.ordered),
                )
            ),
        )
        for name, wanted, given, kinds in ranks:
            if kinds.index(wanted) > kinds.index(given):
                yield _differs(name, wanted, given)
        for name, maximum, time in (
            ("deadline", self.deadline, offered.deadline),
            ("lease duration", self.lease, offered.lease),
            ("latency budget", self.latency, offered.latency),
        ):
            if time > maximum:
                yield _differs(name, _seconds(maximum), _seconds(time))
        if self.exclusive != offered.exclusive:
            ownership = ("shared", "exclusive")
            wanted, given = ownership[self.exclusive], ownership[offered.exclusive]
            yield _differs("ownership", wanted, given)


def _differs(policy: str, wanted: str, given: str) -> str:
    return f"the subscription requests the {policy} {wanted}, the publisher offers {given}"


def _seconds(time: float) -> str:
    return f"{time:.6g} s" if time < inf else "infinite"


SENSOR_QOS = Qos(reliable=False)
"""Quality of service of sensor data, which any publisher satisfies."""
LATCHED_QOS = Qos(durability="transient local", depth=1)
"""Quality of service of maps and descriptions, which late subscriptions receive, too."""


def ros_qos(qos: Any, policy: Any) -> Qos:
    """Return the quality of service of a discovered endpoint.

    Args:
        qos: QoS of Cyclone DDS; a policy that it lacks has the default of DDS.
        policy: ``cyclonedds.core.Policy``.
    """
    history, reliability = qos[policy.History], qos[policy.Reliability]
    deadline, latency = qos[policy.Deadline], qos[policy.LatencyBudget]
    liveliness, access = qos[policy.Liveliness], qos[policy.PresentationAccessScope]
    kinds: tuple[Any, ...] = (policy.Liveliness.Automatic,)
    kinds += policy.Liveliness.ManualByParticipant, policy.Liveliness.ManualByTopic
    durabilities: tuple[Any, ...] = (policy.Durability.Volatile, policy.Durability.TransientLocal)
    durabilities += policy.Durability.Transient, policy.Durability.Persistent
    scope = policy.PresentationAccessScope
    scopes: tuple[Any, ...] = (scope.Instance, scope.Topic, scope.Group)
    return Qos(
        reliable=isinstance(reliability, policy.Reliability.Reliable),
        durability=_one(get_args(Durability), qos[policy.Durability], durabilities),
        depth=getattr(history, "depth", 0) if history is not None else 1,
        deadline=_time(deadline.deadline) if deadline is not None else inf,
        liveliness=_one(get_args(Liveliness), liveliness, kinds),
        lease=_time(liveliness.lease_duration) if liveliness is not None else inf,
        exclusive=qos[policy.Ownership] == policy.Ownership.Exclusive,
        order=get_args(DestinationOrder)[
            qos[policy.DestinationOrder] == policy.DestinationOrder.BySourceTimestamp
        ],
        access=_one(get_args(Access), access, scopes),
        coherent=access is not None and access.coherent_access,
        ordered=access is not None and access.ordered_access,
        latency=_time(latency.budget) if latency is not None else 0.0,
    )


def _one(names: tuple[Any, ...], found: Any, kinds: tuple[Any, ...]) -> Any:
    """Return the name of a policy's kind, which is a class or a single value; None: the first."""
    for name, kind in zip(names, kinds, strict=True):
        if isinstance(found, kind) if isinstance(kind, type) else found == kind:
            return name
    return names[0]


def _time(nanoseconds: int) -> float:
    """Return a duration, s."""
    return inf if nanoseconds >= _FOREVER else 1e-9 * nanoseconds
