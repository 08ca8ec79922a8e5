"""The page `docs/keys.md`: every key, its payload and an example, written from the tables."""

import re
from collections.abc import Iterator
from typing import Any, Final

from khepera_protocol.zenoh.keys import KEYS, Key
from khepera_protocol.zenoh.payload_model import (
    MOST_JSON,
    MOST_PICTURE,
    MOST_STAMP,
    Payload,
)
from khepera_protocol.zenoh.payloads import Stamp
from khepera_protocol.zenoh.schema import schema_of

from macor_hil.telemetry.examples import EXAMPLES

_HEAD: Final = """# Keys and payloads

Written by `macor-hil keys`. Everything that the emulator and the controller tell of a robot
travels over Zenoh under the keys below, `<robot>` being its name, `khepera` by default. They
listen on this machine only, the emulator on `tcp/127.0.0.1:7447`, the controller on
`tcp/127.0.0.1:7448`.

Every sample has an **encoding** (the last column; for JSON with the name of its schema), a Zenoh
**time stamp**, and as its attachment a **stamp**, JSON as well:
"""

_ACTS: Final = "; has effects: only with a payload, and only on exactly this key"

_QUERIES: Final = f"""Whatever comes over Zenoh is checked before it is used: the key is one of
these, spelt out (no `*`); a picture has {MOST_PICTURE:,} bytes at most, a JSON text
{MOST_JSON:,}, a stamp {MOST_STAMP:,}; no field is unknown, and every number, text and list keeps
to its **bounds**. What does not is not taken; `monitor`, `dashboard`, `record` and `ros2` count it
and say why.

Samples are dropped when a subscriber is too slow, and the sequence numbers
show it. A query gets what the table says, so that whoever comes late knows the latest.

A query may look at many keys at once, such as `khepera/**`: it changes nothing. What has effects
answers only to queries on exactly its key, and only to those with a payload that says so; for a
reset `{{}}` will do. A query that cannot be answered gets an error reply of one sentence.

A query with the parameter `describe`, such as `macor/khepera/decision?describe`, gets the JSON
Schema of the key's payload (`application/schema+json`); `macor-hil keys decision` prints it, too.
"""


def keys_page() -> str:
    """Return the whole page, in Markdown."""
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
    lines = ["| field | type | bounds | meaning |", "|---|---|---|---|"]
    for name, field in _fields(schema_of(payload)):
        meaning = field.get("description", "")
        lines.append(f"| `{name}` | {_kind(field)} | {_bounds(field)} | {meaning} |")
    example = EXAMPLES[payload].model_dump_json(exclude_none=True)
    return ["\n".join(lines), "", f"```json\n{_wrapped(example)}\n```", ""]


def _fields(schema: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the names and schemas of a model's fields, and of the models in them."""
    for name, field in schema["properties"].items():
        yield f"{prefix}{name}", field
        suffix = ""
        while "items" in field:
            field, suffix = field["items"], f"{suffix}[]"
        if "properties" in field:
            yield from _fields(field, f"{prefix}{name}{suffix}.")


def _kind(field: dict[str, Any]) -> str:
    if "enum" in field:
        return " or ".join(f"`{value}`" for value in field["enum"])
    if field["type"] != "array":
        return str(field["type"])
    least, most = field.get("minItems"), field.get("maxItems")
    count = f"{most} x" if least == most else "list of"
    return f"{count} {_kind(field['items'])}"


def _bounds(field: dict[str, Any]) -> str:
    """Return what a field keeps to: lengths of lists and texts, least and greatest numbers."""
    if "pattern" in field:
        return f"`{field['pattern']}`".replace("|", "\\|")
    if "maxLength" in field:
        return f"{field['maxLength']:,} characters"
    if "items" in field:
        least, most = field.get("minItems", 0), field["maxItems"]
        lengths = f"{least} to {most:,}" if least else f"{most:,} at most"
        return "; ".join(filter(None, ["" if least == most else lengths, _bounds(field["items"])]))
    least = field.get("minimum", field.get("exclusiveMinimum"))
    if least is None:
        return ""
    above = "above " if "exclusiveMinimum" in field else ""
    return f"{above}{_number(least)} to {_number(field['maximum'])}"


def _number(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else re.sub(r"e\+0*", "e", f"{value:g}")


def _wrapped(text: str, width: int = 100) -> str:
    """Return a JSON text in lines, broken after commas."""
    lines, line = [], ""
    for part in text.replace(",", ",\0").split("\0"):
        if len(line) + len(part) > width:
            lines.append(line)
            line = ""
        line += part
    return "\n".join([*lines, line])
