"""Options of a node in a ROS 2 graph, for several verbs."""

from __future__ import annotations

from typing import Annotated, Any

from omnidrive.cli.options import choice, choose_one, option

_DISTRIBUTIONS = ("humble", "iron", "jazzy", "kilted", "lyrical", "rolling")
_GRAPH_PANEL = "Graph"
DomainOption = Annotated[
    int | None, option("N", "Domain [default: ROS_DOMAIN_ID, or 0].", _GRAPH_PANEL, minimum=0)
]
PeersOption = Annotated[
    list[str] | None,
    option(
        "HOST",
        "Host of other nodes, asked by unicast (repeatable), such as localhost [default: all hosts "
        "of the network, by multicast].",
        _GRAPH_PANEL,
        "--peer",
    ),
]
DistributionOption = Annotated[
    str | None,
    choice(
        _DISTRIBUTIONS,
        "Distribution of the other nodes [default: ROS_DISTRO, or as they announce themselves].",
        _GRAPH_PANEL,
    ),
]


def node_options(domain: int | None, peers: list[str] | None, distribution: str | None) -> Any:
    """Return the arguments of a node, checked."""
    chosen = None
    if distribution is not None:
        chosen = choose_one("distribution", distribution, _DISTRIBUTIONS)
    return {"domain": domain, "peers": tuple(peers or ()), "distribution": chosen}
