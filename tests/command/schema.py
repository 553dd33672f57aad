# SPDX-License-Identifier: Apache-2.0
"""The keywords of JSON Schema that src/cli/schema.json uses."""

TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float),
         "null": type(None)}
KNOWN = {"$schema", "$id", "title", "description", "$defs", "$ref", "type", "properties", "required", "minimum", "maximum",
         "additionalProperties", "items", "enum", "const", "oneOf"}


def strict(schema):
    """The schema for our own reports, without members that it does not name: others find a misspelt one nowhere."""
    if isinstance(schema, list):
        return [strict(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    changed = {name: strict(part) for name, part in schema.items()}
    if isinstance(schema.get("properties"), dict) and "additionalProperties" not in schema:
        changed["additionalProperties"] = False
    return changed


def is_type(value, name):
    return isinstance(value, TYPES[name]) and not (isinstance(value, bool) and name in ("integer", "number"))


def faults(value, schema, place="$", whole=None):
    """What of `value` breaks the schema, which has only the keywords above. `whole`: where its $defs are."""
    whole = whole or schema
    assert set(schema) <= KNOWN, set(schema) - KNOWN
    found = []
    if "$ref" in schema:
        found += faults(value, whole["$defs"][schema["$ref"].removeprefix("#/$defs/")], place, whole)
    if "oneOf" in schema:
        each = [faults(value, choice, place, whole) for choice in schema["oneOf"]]
        if sum(not f for f in each) != 1:
            found += min(each, key=len) or [f"{place}: several of oneOf"]
    types = schema.get("type", [])
    types = [types] if isinstance(types, str) else types
    if types and not any(is_type(value, name) for name in types):
        return found + [f"{place}: {value!r} is not {types}"]
    if "const" in schema and value != schema["const"] or "enum" in schema and value not in schema["enum"]:
        found.append(f"{place}: {value!r} is not {schema.get('const', schema.get('enum'))}")
    if not schema.get("minimum", float("-inf")) <= (value if is_type(value, "number") else 0) <= schema.get("maximum", float("inf")):
        found.append(f"{place}: {value} is out of range")
    if isinstance(value, list) and "items" in schema:
        for i, element in enumerate(value):
            found += faults(element, schema["items"], f"{place}[{i}]", whole)
    if isinstance(value, dict):
        found += [f"{place}: {name} is missing" for name in schema.get("required", []) if name not in value]
        more = schema.get("additionalProperties", True)
        for name, member in value.items():
            if name in schema.get("properties", {}):
                found += faults(member, schema["properties"][name], f"{place}.{name}", whole)
            elif more is False:
                found.append(f"{place}: {name} is unknown")
            elif more is not True:
                found += faults(member, more, f"{place}.{name}", whole)
    return found
