"""Text of an MJCF model with its included and attached files, without what is not read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

from omnidrive.errors import InvalidRobot, one_line
from omnidrive.files.xml_elements import Element
from omnidrive.robot.imports.attributes import malformed, positive_or_zero
from omnidrive.robot.imports.wheel_mounts import listed

ReadXml = Callable[[Path], Element]
"""Returns the root element of a file."""

MAX_ELEMENTS = 20_000
"""Maximum number of elements of a model, with files and copies."""

_MAX_FILES = 100
_MAX_LEVELS = 8
_UNREAD = {
    "option", "size", "visual", "statistic", "contact", "equality", "tendon", "sensor", "keyframe",
    "custom", "deformable", "extension",
}  # fmt: skip
_IN_BODY = {"camera", "light", "plugin"}
_REFUSED = {"composite", "flexcomp", "flex"}
_ATTRIBUTES = {"material", "user", "actdim", "nsample", "delay", "interp"}
"""Attributes that are not read; for states and histories of any size MuJoCo allocates memory."""
_WEIGHTS = {"geom": ("mass", "density"), "inertial": ("mass",)}


class MjcfSource:
    """Reads the files of one model.

    Attributes:
        models: Texts of attached models by the names of their files.
        warnings: Parts that are not read.
    """

    def __init__(self, path: Path, read: ReadXml) -> None:
        self.models: dict[str, bytes] = {}
        self.warnings: list[str] = []
        self._path = path
        self._read = read
        self._folder = path.parent.resolve()
        self._files = 0
        self._count = 0

    def text(self, root: Element) -> str:
        """Return the text of the model, in which all files are those of :attr:`models`.

        Raises:
            InvalidRobot: A file is missing or outside the folder, or the model is too large.
        """
        return "".join(self._model(root, self._path, (), 1))

    def _model(
        self, root: Element, path: Path, trail: tuple[Path, ...], copies: int
    ) -> Iterator[str]:
        trail = (*trail, path.resolve())
        sizes: dict[str, int] = {}
        names: dict[str, str] = {}
        top = list(self._included(root, path, trail))
        for section in top:
            for asset in section.all("model") if section.tag == "asset" else ():
                name, key = asset.attributes.get("name", ""), f"{len(self.models)}.xml"
                file = self._other(asset, path, trail)
                self.models[key] = b""  # it keeps the key
                before = self._count
                text = "".join(self._model(self._load(asset, file), file, trail, 1))
                sizes[name or file.stem] = self._count - before
                names[name or file.stem] = key
                self.models[key] = text.encode()
        yield f"<mujoco model={quoteattr(root.attributes.get('model', 'robot'))}>"
        assets = "".join(
            f'<model name={quoteattr(name)} file="{key}"/>' for name, key in names.items()
        )
        yield f"<asset>{assets}</asset>" if assets else ""
        for section in top:
            if section.tag not in _UNREAD | {"asset"}:
                yield from self._element(section, path, trail, copies, sizes)
        yield "</mujoco>"

    def _element(
        self,
        element: Element,
        path: Path,
        trail: tuple[Path, ...],
        copies: int,
        sizes: dict[str, int],
    ) -> Iterator[str]:
        """Yield the text of an element; ``copies`` are those of replicated parents."""
        tag = element.tag
        self._count += copies * (sizes.get(element.attributes.get("model", ""), 0) + 1)
        if tag == "replicate":
            words = element.attributes.get("count", "1").split()
            digits = words[0] if len(words) == 1 and words[0].isdecimal() else ""
            copies *= int(digits) if 0 < len(digits) < 7 else MAX_ELEMENTS + 1
            if copies > MAX_ELEMENTS:
                raise malformed(
                    element.position, f"<replicate> is not supported beyond {MAX_ELEMENTS} elements"
                )
        if self._count > MAX_ELEMENTS:
            raise malformed(element.position, f"more than {MAX_ELEMENTS} elements with all copies")
        if tag in _REFUSED:
            raise malformed(
                element.position,
                f"<{tag}> is not supported; remove it, or save the compiled model by "
                "mj_saveLastXML",
            )
        for name in _WEIGHTS.get(tag, ()):
            positive_or_zero(element, name, 0.0)
        attributes = "".join(
            f" {name}={quoteattr(value)}"
            for name, value in element.attributes.items()
            if name not in _ATTRIBUTES
        )
        yield f"<{element.qualified[0]}{attributes}>"
        parts = list(self._included(element, path, trail))
        if tag == "actuator":
            self._note_actuators([each for each in parts if not _is_motor(each)])
            parts = [each for each in parts if _is_motor(each)]
        for each in parts:
            if each.tag not in _IN_BODY:
                yield from self._element(each, path, trail, copies, sizes)
        yield f"</{element.qualified[0]}>"

    def _included(self, element: Element, path: Path, trail: tuple[Path, ...]) -> Iterator[Element]:
        """Yield the children of an element, with those of included files in their places."""
        for each in element.children:
            if each.tag != "include":
                yield each
                continue
            file = self._other(each, path, trail)
            root = self._load(each, file)
            if root.tag not in {"mujoco", "mujocoinclude"}:
                raise malformed(each.position, f"<include>: {file.name} is no MJCF")
            yield from self._included(root, file, (*trail, file.resolve()))

    def _other(self, element: Element, path: Path, trail: tuple[Path, ...]) -> Path:
        """Return the file of an element: beside the file with the element, or the main one."""
        name = element.get("file")
        shown = f"<{element.tag}> is not supported"
        for folder in (path.parent, self._path.parent):
            try:
                file = (folder / name).resolve()
                inside = file.is_relative_to(self._folder)
                exists = inside and file.is_file()
            except (OSError, ValueError, RuntimeError):
                inside = exists = False
            if not inside:
                raise malformed(
                    element.position,
                    f"{shown} outside the folder of the model: '{one_line(name, 200)}'; copy the "
                    "file there, or save the compiled model by mj_saveLastXML",
                )
            if exists:
                break
        else:
            raise malformed(
                element.position, f"<{element.tag}>: there is no file '{one_line(name, 200)}'"
            )
        if file in trail:
            raise malformed(
                element.position, f"<{element.tag}>: '{one_line(name, 200)}' contains itself"
            )
        if len(trail) > _MAX_LEVELS:
            raise malformed(element.position, f"files are nested more than {_MAX_LEVELS} deep")
        return file

    def _load(self, element: Element, file: Path) -> Element:
        self._files += 1
        if self._files > _MAX_FILES:
            raise malformed(element.position, f"more than {_MAX_FILES} files")
        try:
            return self._read(file)
        except InvalidRobot as error:
            raise InvalidRobot(f"{one_line(file.name)}: {error}") from None

    def _note_actuators(self, others: list[Element]) -> None:
        if others:
            names = [each.attributes.get("name", f"<{each.tag}>") for each in others]
            self.warnings.append(f"actuators that act on no joint are not read: {listed(names)}")


def _is_motor(element: Element) -> bool:
    """Return whether an actuator acts on a joint."""
    return element.tag != "plugin" and bool({"joint", "jointinparent"} & element.attributes.keys())
