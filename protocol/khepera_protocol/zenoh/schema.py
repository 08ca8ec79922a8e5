"""JSON Schemas of payloads in the plain form that viewers of recordings read.

Their parsers know objects, lists of objects or of simple values, and one type for a field: no
references, no alternatives, no lists of lists.
"""

from typing import Any

from khepera_protocol.zenoh.payload_model import Payload


def schema_of(payload: type[Payload]) -> dict[str, Any]:
    """Return the JSON Schema of a payload: what `describe` answers and recordings hold."""
    whole = payload.model_json_schema()
    schema: dict[str, Any] = _plain(whole, whole.pop("$defs", {}))
    return schema


def _plain(node: Any, models: dict[str, Any]) -> Any:
    """Return a part of a schema with what it refers to in it."""
    if isinstance(node, list):
        return [_plain(each, models) for each in node]
    if not isinstance(node, dict):
        return node
    node = dict(node)
    if reference := node.pop("$ref", None):
        node = {**models[reference.rpartition("/")[2]], **node}
    if alternatives := node.pop("anyOf", None):
        # a field that may be absent; null, too, is taken for that, and never sent
        (kind,) = (each for each in alternatives if each != {"type": "null"})
        node = {**_plain(kind, models), **node}
        node.pop("default", None)
    if items := node.pop("prefixItems", None):
        node["items"] = items[0]  # so many of one kind
    return {name: _plain(value, models) for name, value in node.items()}
