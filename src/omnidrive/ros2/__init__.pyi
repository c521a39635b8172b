from .cdr import decode, encode
from .doctor import Examination, Finding, diagnose, examine
from .graph import Endpoint, Graph, Participant
from .interface import Distribution, definition_text, interface, interfaces
from .message import Message, message_type
from .node import Node, Publisher, Received, Subscription
from .qos import LATCHED_QOS, SENSOR_QOS, Qos
from .type_hash import type_hash

__all__ = [
    "LATCHED_QOS",
    "SENSOR_QOS",
    "Distribution",
    "Endpoint",
    "Examination",
    "Finding",
    "Graph",
    "Message",
    "Node",
    "Participant",
    "Publisher",
    "Qos",
    "Received",
    "Subscription",
    "decode",
    "definition_text",
    "diagnose",
    "encode",
    "examine",
    "interface",
    "interfaces",
    "message_type",
    "type_hash",
]
