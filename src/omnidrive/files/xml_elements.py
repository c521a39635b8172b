"""Elements of an untrusted XML text with their positions; size and nesting are bounded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from xml.parsers import expat

from omnidrive.files.position import Position

MAX_DEPTH = 32
"""Maximum nesting of elements."""

MAX_ELEMENTS = 1_000_000
"""Maximum number of elements by default; a fuzzy rule has about ten."""

MAX_TEXT = 1000
"""Maximum number of characters directly in an element, which are a name or a number."""

Malformed = Callable[[Position, str], Exception]
"""Returns the error about a fact at a position."""


class Element:
    """An element; prefixes of namespaces are removed, except in ``qualified``.

    Attributes:
        tag: Name of the element.
        attributes: Values of the attributes by name.
        children: Child elements.
        text: Characters directly in the element.
        instructions: Data of the processing instructions directly in the element, by target.
        position: Position of the start tag.
        malformed: Returns the errors of this element.
        qualified: Names of the element and of its attributes as written, with prefixes.
    """

    __slots__ = (
        "attributes",
        "children",
        "instructions",
        "malformed",
        "position",
        "qualified",
        "tag",
        "text",
    )

    def __init__(
        self, tag: str, attributes: dict[str, str], position: Position, malformed: Malformed
    ) -> None:
        self.tag = tag
        self.attributes = attributes
        self.children: list[Element] = []
        self.text = ""
        self.instructions: dict[str, str] = {}
        self.position = position
        self.malformed = malformed
        self.qualified: tuple[str, ...] = (tag, *attributes)

    def walk(self) -> Iterator[Element]:
        """Yield the element and all elements in it."""
        queue = [self]
        for each in queue:  # it grows
            yield each
            queue += each.children

    def all(self, *tags: str) -> Iterator[Element]:
        """Yield the children with one of the tags."""
        return (each for each in self.children if each.tag in tags)

    def first(self, tag: str) -> Element | None:
        """Return the first child with a tag; None: there is none."""
        return next(self.all(tag), None)

    def one(self, *tags: str) -> Element:
        """Return the only child with one of the tags; raise an error unless there is one."""
        found = list(self.all(*tags))
        if len(found) != 1:
            position = found[1].position if found else self.position
            raise self.malformed(
                position, f"{self.tag}: expected one {' or '.join(tags)}, got {len(found)}"
            )
        return found[0]

    def get(self, name: str) -> str:
        """Return the value of an attribute; raise an error if it is missing."""
        if name not in self.attributes:
            raise self.malformed(self.position, f"{self.tag[:40]}: expected the attribute {name}")
        return self.attributes[name]


def read_xml(text: str, malformed: Malformed, *, max_elements: int = MAX_ELEMENTS) -> Element:
    """Return the root element of an XML text.

    Args:
        text: The text.
        malformed: Returns the error to raise if the text is not well-formed, has a DOCTYPE (which
            may define entities), or exceeds a limit.
        max_elements: Maximum number of elements.
    """
    return _Builder(malformed, max_elements).root(text)


class _Builder:
    def __init__(self, malformed: Malformed, max_elements: int) -> None:
        self._malformed = malformed
        self._max_elements = max_elements
        self._parser = expat.ParserCreate("utf-8")
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.ProcessingInstructionHandler = self._instruction
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._open: list[Element] = []
        self._count = 0
        self._root: Element | None = None

    def root(self, text: str) -> Element:
        """Parse a document and return its root element."""
        try:
            self._parser.Parse(text.encode("utf-8", "surrogatepass"), True)
        except expat.ExpatError as error:
            position = Position(error.lineno, error.offset + 1)
            fact = f"not XML: {expat.ErrorString(error.code)}"
            raise self._malformed(position, fact) from None
        if self._root is None:
            raise self._malformed(Position(1, 1), "not XML: there is no element")
        return self._root

    @property
    def _position(self) -> Position:
        return Position(self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if len(self._open) >= MAX_DEPTH:
            raise self._malformed(self._position, f"elements are nested more than {MAX_DEPTH} deep")
        if self._count > self._max_elements:
            raise self._malformed(self._position, f"more than {self._max_elements} elements")
        local = {name.rpartition(":")[2]: value for name, value in attributes.items()}
        element = Element(tag.rpartition(":")[2], local, self._position, self._malformed)
        element.qualified = (tag, *attributes)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)

    def _end(self, _tag: str) -> None:
        self._open.pop()

    def _characters(self, data: str) -> None:
        element = self._open[-1]
        if element.text or not data.isspace():
            element.text += data
        if len(element.text) > MAX_TEXT:
            raise self._malformed(
                element.position, f"{element.tag[:40]}: more than {MAX_TEXT} characters"
            )

    def _instruction(self, target: str, data: str) -> None:
        if self._open:
            self._open[-1].instructions[target] = data

    def _doctype(self, *_: object) -> None:
        raise self._malformed(self._position, "a DOCTYPE is not supported; remove it")
