"""JSON schema of scenario files, for editors and for the reference page."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from omnidrive.components.documentation import field_docs, plain_text
from omnidrive.components.fields import plain
from omnidrive.scenario.scenario import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema of scenario files, with the parameters of all installed components.

    Descriptions are in Markdown; the keyword ``unit`` holds the unit of a number.
    """
    schema = Scenario.model_json_schema(schema_generator=_Generator)
    controllers = schema["properties"]["controllers"]
    one, text = controllers["additionalProperties"], controllers.pop("description")
    names = {"type": "array", "items": one["anyOf"][0], "uniqueItems": True, "minItems": 1}
    schema["properties"]["controllers"] = {"description": text, "anyOf": [names, controllers]}
    for key in ("robot", "plant_robot"):
        section = schema["properties"][key]
        others = section.pop("anyOf", None) or [{"$ref": section.pop("$ref")}]
        section["anyOf"] = [{"type": "string"}, *others]
    return {"$schema": DIALECT, "title": "omnidrive scenario"} | schema


class _Generator(GenerateJsonSchema):
    """Generator that takes descriptions from docstrings."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        """Return False: the titles would repeat the names of the keys."""
        return False

    def model_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a pydantic model."""
        return _documented(super().model_schema(schema), schema["cls"])

    def dataclass_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a dataclass."""
        return _documented(super().dataclass_schema(schema), schema["cls"])

    def named_tuple_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a named tuple: keys, or values in their order."""
        return _by_name(super().named_tuple_schema(schema), schema["cls"])

    def call_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a named tuple, for pydantic before 2.14."""
        return _by_name(super().call_schema(schema), schema["function"])

    def default_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema with its default, also of a factory."""
        found = super().default_schema(schema)
        if "default_factory" in schema and not schema.get("default_factory_takes_data"):
            found["default"] = plain(schema["default_factory"]())
        return found


def _by_name(values: JsonSchemaValue, cls: Any) -> JsonSchemaValue:
    """Return the schema of a named tuple from that of its values in their order."""
    keys = {
        "type": "object",
        "properties": dict(zip(cls._fields, map(dict, values["prefixItems"]), strict=True)),
        "required": list(cls._fields[: values.get("minItems", 0)]),
        "additionalProperties": False,
    }
    keys = _documented(keys, cls)
    return {"description": keys.pop("description"), "anyOf": [keys, values]}


def _documented(schema: JsonSchemaValue, cls: Any) -> JsonSchemaValue:
    """Return the schema of a class with descriptions of the class and of its keys."""
    schema.pop("title", None)
    schema["description"] = plain_text(cls.__doc__ or "")
    docs = field_docs(cls)
    for name, each in schema.get("properties", {}).items():
        text = " ".join(filter(None, (docs.get(name), _range(each))))
        if text:
            each["description"] = text
    return schema


def _range(schema: Any) -> str:
    """Return the range of a number as a sentence."""
    for each in (schema, *schema.get("anyOf", ())):
        if "minimum" in each and "maximum" in each:
            unit = each.get("unit", "")
            return f"Range: {each['minimum']:g} to {each['maximum']:g} {unit}".rstrip() + "."
    return ""
