"""The page `docs/keys.md`: every key, its payload and an example, written from the tables."""

from collections.abc import Iterator
from typing import Any, Final

from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.keys import KEYS
from protocol.keys import Key
from protocol.side_channel import Payload, Stamp

_HEAD: Final = """# Keys and payloads

Written by `macor-hil keys`. Everything that the emulator and the controller tell of a robot
travels over Zenoh under the keys below, `<robot>` being its name, `khepera` by default. They
listen on this machine only, the emulator on `tcp/127.0.0.1:7447`, the controller on
`tcp/127.0.0.1:7448`.

Every sample has an **encoding** (the last column; for JSON with the name of its schema), a Zenoh
**time stamp**, and as its attachment a **stamp**, JSON as well:
"""

_ACTS: Final = "; has effects: only with a payload, and only on exactly this key"

_QUERIES: Final = """Samples are dropped when a subscriber is too slow, and the sequence numbers
show it. A query gets what the table says, so that whoever comes late knows the latest.

A query may look at many keys at once, such as `khepera/**`: it changes nothing. What has effects
answers only to queries on exactly its key, and only to those with a payload, which may be `{}`.
A query that cannot be answered gets an error reply of one sentence.

A query with the parameter `describe`, such as `macor/khepera/decision?describe`, gets the JSON
Schema of the key's payload (`application/schema+json`); `macor-hil keys decision` prints it, too.
"""


def keys_page() -> str:
    """The whole page, in Markdown."""
    parts = [_HEAD, *_payload(Stamp), _QUERIES, _table()]
    described: set[type[Payload]] = set()
    for key in KEYS:
        for payload in (key.request, key.payload):
            if payload and payload not in described:
                described.add(payload)
                parts += [f"## {payload.__name__}\n", f"{_keys_of(payload)}\n", *_payload(payload)]
    return "\n".join(parts)


def _table() -> str:
    lines = ["| key | tells | published | a query gets | encoding |", "|---|---|---|---|---|"]
    for key in KEYS:
        payload = f" ({_link(key.payload)})" if key.payload else ""
        asks = f"; takes a {_link(key.request)}" if key.request else ""
        asks += _ACTS if key.acts else ""
        encodings = ", ".join(f"`{encoding}`" for encoding in key.encodings)
        lines.append(
            f"| `{key.pattern}` | {key.what}{payload} | {key.published} | {key.answers}{asks}"
            f" | {encodings} |"
        )
    return "\n".join([*lines, ""])


def _link(payload: type[Payload]) -> str:
    return f"[{payload.__name__}](#{payload.__name__.lower()})"


def _keys_of(payload: type[Payload]) -> str:
    def uses(key: Key) -> Iterator[str]:
        if key.payload is payload:
            yield f"`{key.pattern}`"
        if key.request is payload:
            yield f"queries on `{key.pattern}`"

    where = [use for key in KEYS for use in uses(key)]
    return f"{(payload.__doc__ or '').strip()} On {', '.join(where)}."


def _payload(payload: type[Payload]) -> list[str]:
    schema = payload.model_json_schema()
    lines = ["| field | type | meaning |", "|---|---|---|"]
    for name, kind, meaning in _fields(schema, schema.get("$defs", {})):
        lines.append(f"| `{name}` | {kind} | {meaning} |")
    example = EXAMPLES[payload].model_dump_json(exclude_none=payload.__name__ == "Reset")
    return ["\n".join(lines), "", f"```json\n{_wrapped(example)}\n```", ""]


def _fields(
    schema: dict[str, Any], models: dict[str, Any], prefix: str = ""
) -> Iterator[tuple[str, str, str]]:
    for name, field in schema.get("properties", {}).items():
        kind, inner, suffix = _kind(field, models)
        yield f"{prefix}{name}", kind, field.get("description", "")
        if inner:
            yield from _fields(inner, models, f"{prefix}{name}{suffix}.")


def _kind(field: dict[str, Any], models: dict[str, Any]) -> tuple[str, dict[str, Any] | None, str]:
    """What a field is, the model in it if there is one, and how its place is written."""
    if "$ref" in field:
        model = models[field["$ref"].rpartition("/")[2]]
        if "enum" in model:
            return " or ".join(f"`{value}`" for value in model["enum"]), None, ""
        return "object", model, ""
    if "anyOf" in field:
        kinds = [_kind(each, models) for each in field["anyOf"]]
        inner = next((kind[1] for kind in kinds if kind[1]), None)
        return " or ".join(kind[0] for kind in kinds), inner, ""
    if field.get("type") == "array":
        items = field.get("items")
        if items is None:
            numbers = field["prefixItems"]
            return f"{len(numbers)} x {numbers[0]['type']}", None, ""
        kind, inner, _ = _kind(items, models)
        return f"list of {kind}", inner, "[]"
    return str(field.get("type", "any")), None, ""


def _wrapped(text: str, width: int = 100) -> str:
    """JSON text in lines, broken after commas."""
    lines, line = [], ""
    for part in text.replace(",", ",\0").split("\0"):
        if len(line) + len(part) > width:
            lines.append(line)
            line = ""
        line += part
    return "\n".join([*lines, line])
