from .cdr import decode, encode
from .interface import Distribution, definition_text, interface, interfaces
from .message import Message, message_type
from .type_hash import type_hash

__all__ = [
    "Distribution",
    "Message",
    "decode",
    "definition_text",
    "encode",
    "interface",
    "interfaces",
    "message_type",
    "type_hash",
]
