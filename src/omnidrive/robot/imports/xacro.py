"""Descriptions of robots that need xacro, the macro language of ROS, before they can be read."""

from __future__ import annotations

import re

from omnidrive.errors import one_line
from omnidrive.files.xml_elements import Element
from omnidrive.robot.imports.attributes import malformed

_EXPRESSION = re.compile(
    r"(?<!\$)\$\{[^}]*\}?|(?<!\$)\$\((?:arg|find|eval|env|optenv|dirname|anon|cwd)\b[^)]*\)?"
)


def refuse_xacro(root: Element, name: str) -> None:
    """Refuse elements, attributes and expressions of xacro, wherever they are.

    An expanded file may still declare the namespace (http://wiki.ros.org/xacro).

    Args:
        root: The root element.
        name: Name of the file.

    Raises:
        InvalidRobot: The description is not expanded; the message gives the command.
    """
    prefixes = {"xacro"}
    for element in root.walk():
        prefixes |= {
            key.partition(":")[2]
            for key in element.qualified[1:]
            if key.startswith("xmlns:") and "xacro" in element.attributes[key.rpartition(":")[2]]
        }
        found = next((key for key in element.qualified if key.partition(":")[0] in prefixes), None)
        if found is not None:
            found = f"<{found}>" if found == element.qualified[0] else f"{element.tag}: {found}"
        for text in (element.text, *element.attributes.values()):
            match = _EXPRESSION.search(text) if found is None and "$" in text else None
            found = f"{element.tag}: {match.group()}" if match else found
        if found is not None:
            source = one_line(name)
            target = source.removesuffix(".xacro").removesuffix(".urdf")
            target = f"{target}.urdf" if f"{target}.urdf" != source else f"{target}_expanded.urdf"
            raise malformed(
                element.position,
                f"{one_line(found, 80)} is xacro; expand the file by xacro first: "
                f"xacro {source} > {target}",
            )
