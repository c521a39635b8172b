"""Facts about a study that its report states beside the results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from omnidrive.evaluation.palette import ControllerStyle, styles_of
from omnidrive.evaluation.study_logs import ControllerType


@dataclass(frozen=True, slots=True)
class StudyFacts:
    """What a study is, and how to repeat it.

    Attributes:
        name: Name of the study.
        question: The question that it answers; may be empty.
        setup: Facts about base scenario, axes, random factors and repetitions, by their names.
        types: Type and parameters of each controller by its label.
        planned: Number of planned runs.
        definition: Text of the study file.
        file: Name of the study file.
        command: Command that repeats the study, given the study file.
        resume: Command that computes missing runs.
        hashes: SHA-256 in hexadecimal digits of what the results depend on and of the results, by
            their names.
        versions: Versions of the distributions that computed the results, as far as they are known.
        until: Stop rule of a study that ends when its intervals are narrow enough; empty: none.
        damaged: Sentence without its end on stored runs that are damaged; empty: none is.
        published: What of the paper is shown: its ``values`` beside those of one run per
            controller, or whether its ``claims`` hold; empty: nothing.
        failures: Name and reason of each run that ended early; empty: there are many, or none.
    """

    name: str
    question: str = ""
    setup: Mapping[str, str] = field(default_factory=dict)
    types: Mapping[str, ControllerType] = field(default_factory=dict)
    planned: int = 0
    definition: str = ""
    file: str = "study.yaml"
    command: str = ""
    resume: str = ""
    hashes: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    until: str = ""
    damaged: str = ""
    published: Literal["", "values", "claims"] = ""
    failures: tuple[tuple[str, str], ...] = ()

    def styles(self, controllers: tuple[str, ...]) -> dict[str, ControllerStyle]:
        """Return the style of every controller, by its label."""
        types = {label: kind.name for label, kind in self.types.items()}
        return styles_of({label: types.get(label, label) for label in controllers})
