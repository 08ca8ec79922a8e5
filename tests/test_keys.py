"""The table of Zenoh keys: what is declared is what is documented."""

import json
from pathlib import Path

import pytest
import zenoh
from as_type import not_none
from controller_helpers import a_decision, ask, ask_until, free_endpoint, publishing, watching
from emulator_process import emulator
from khepera_protocol.zenoh.controller_payloads import Alternative
from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR, KEYS, PUSH, SCHEMA_MEDIA_TYPE, Key
from khepera_protocol.zenoh.payloads import CameraQuery, Outline, Stamp
from khepera_protocol.zenoh.schema import schema_of
from typer.testing import CliRunner

from macor_hil.cli.program import app
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.keys_page import keys_page

PAGE = Path(__file__).parent.parent / "docs" / "keys.md"


def test_the_page_is_what_the_tables_say() -> None:
    assert PAGE.read_text("utf-8") == keys_page()


def test_the_page_has_every_key_once_and_an_example_of_every_payload() -> None:
    text = keys_page()
    for key in KEYS:
        assert text.count(f"| `{key.pattern}` |") == 1
        for payload in (key.payload, key.request):
            if payload:
                assert f"## {payload.__name__}\n" in text
                assert EXAMPLES[payload]


@pytest.mark.parametrize("payload", list(EXAMPLES), ids=lambda kind: kind.__name__)
def test_examples_keep_their_schemas(payload: type[CameraQuery] | type[Stamp]) -> None:
    text = EXAMPLES[payload].model_dump_json()
    assert payload.model_validate_json(text) == EXAMPLES[payload]
    fields = payload.model_json_schema()["properties"]
    assert set(json.loads(text)) == set(fields)


def test_corners_that_are_pairs_are_read_as_before() -> None:
    outline = EXAMPLES[Outline]
    old = json.loads(outline.model_dump_json())
    for solid in old["solids"]:
        solid["corners"] = [[corner["x"], corner["y"]] for corner in solid["corners"]]
    assert Outline.parse(json.dumps(old).encode()) == Outline.model_validate(old) == outline


def test_an_evaluation_that_does_not_exist_is_left_out() -> None:
    text = Alternative(command="left", evaluation=None).model_dump_json()
    assert text == '{"command":"left"}'
    for data in (text, '{"command":"left","evaluation":null}'):
        assert Alternative.parse(data.encode()).evaluation is None


def answering(side: str) -> list[Key]:
    return [key for key in KEYS if key.side == side and key.payload]


def test_the_controller_describes_every_json_key() -> None:
    endpoint = free_endpoint()
    with publishing(endpoint), watching(endpoint) as (session,):
        for key in answering(CONTROLLER):
            described(session, key)


def test_the_emulator_describes_and_answers_every_json_key() -> None:
    endpoint = free_endpoint()
    with emulator("--listen", endpoint), watching(endpoint) as (session,):
        for key in answering(EMULATOR):
            described(session, key)
            if key is PUSH:
                continue  # there is no thing
            # what has effects wants to be told so
            payload = "{}" if key.acts else None
            sample = ask(session, key.pattern.replace("<robot>", "khepera"), payload).ok
            not_none(key.payload).model_validate_json(not_none(sample).payload.to_bytes())
            assert (str(not_none(sample).encoding),) == key.encodings
            assert not_none(sample).timestamp is not None
            assert (
                Stamp.model_validate_json(not_none(not_none(sample).attachment).to_bytes()).sequence
                == 0
            )


def described(session: zenoh.Session, key: Key) -> None:
    name = key.pattern.replace("<robot>", "khepera")
    reply = ask(session, f"{name}?describe").ok
    assert str(not_none(reply).encoding) == SCHEMA_MEDIA_TYPE
    assert json.loads(not_none(reply).payload.to_string()) == schema_of(not_none(key.payload))


def test_the_encodings_of_the_table_are_those_of_the_samples() -> None:
    endpoint = free_endpoint()
    with publishing(endpoint) as (_, publisher), watching(endpoint) as (session,):
        publisher.decision(a_decision())
        sample = ask_until(session, "macor/khepera/decision", bool)
    (encoding,) = next(key.encodings for key in KEYS if key.leaf == "decision")
    assert str(sample.encoding) == encoding


def test_the_command_prints_the_page_and_schemas() -> None:
    assert CliRunner().invoke(app, ["keys"]).stdout == keys_page()
    schema = json.loads(CliRunner().invoke(app, ["keys", "decision"]).stdout)
    assert schema["title"] == "Decision"
    assert "no key of JSON samples" in str(CliRunner().invoke(app, ["keys", "frame"]).exception)
