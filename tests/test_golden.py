"""Conversations with both robots, compared to the letter with the transcripts in `golden`."""

from pathlib import Path

import pytest
from khepera_protocol.epuck.generations import BTCOM, GCTRONIC, GCTRONIC2
from khepera_protocol.serial.commands import COMMANDS, FLASH_TOOLS, TOOLS
from khepera_protocol.serial.messages import COMMAND_NOT_FOUND, PROTOCOL_ERROR, TURRET_NOT_SUPPORTED
from khepera_protocol.serial.turrets import TURRETS
from transcripts import FOLDER, Exchange, exchanges, play, url_of

from khepera_emulator.models import KHEPERA, KHEPERA2
from khepera_emulator.robot.khepera.choices import option_names

FILES = sorted(FOLDER.glob("*.txt"))
KHEPERAS = {model.name: model for model in (KHEPERA, KHEPERA2)}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_conversation_is_the_same(path: Path, request: pytest.FixtureRequest) -> None:
    text = path.read_text()
    again = play(text)
    if request.config.getoption("--update-golden"):
        path.write_text(again)
    else:
        assert again == text


def said(model: str) -> list[Exchange]:
    texts = [path.read_text() for path in FILES]
    return [pair for text in texts if f"model={model}&" in text for pair in exchanges(text)]


@pytest.mark.parametrize("model", KHEPERAS)
def test_every_letter_occurs_with_its_own_reply(model: str) -> None:
    answered = {
        pair.request[:1].decode("latin-1")
        for pair in said(model)
        if pair.reply and pair.reply[0].split(",")[0] == pair.request[:1].decode("latin-1").lower()
    }
    assert answered == set(COMMANDS)


@pytest.mark.parametrize("model", KHEPERAS)
def test_every_tool_occurs(model: str) -> None:
    found = [COMMAND_NOT_FOUND]
    known = {
        pair.request.split()[0].decode("latin-1")
        for pair in said(model)
        if pair.request.split() and pair.reply and pair.reply != found
    }
    has_flash = KHEPERAS[model].has_flash
    assert known & set(TOOLS) == (set(TOOLS) if has_flash else set(TOOLS) - FLASH_TOOLS)


@pytest.mark.parametrize("model", KHEPERAS)
def test_every_error_occurs(model: str) -> None:
    replies = {line for pair in said(model) for line in pair.reply}
    assert {COMMAND_NOT_FOUND, PROTOCOL_ERROR, TURRET_NOT_SUPPORTED} <= replies


@pytest.mark.parametrize("model", KHEPERAS)
def test_every_turret_message_occurs_with_its_own_reply(model: str) -> None:
    answered = set()
    for pair in said(model):
        head = pair.request.decode("latin-1").split(",")[:3]
        if head[0] == "T" and len(head) == 3:
            prefix = f"t,{head[1]},{head[2].lower()}"
            if any(line.split(",")[:3] == prefix.split(",") for line in pair.reply):
                answered.add((int(head[1]), head[2]))
    assert answered == {
        (kind.number, letter) for kind in TURRETS.values() for letter in kind.messages
    }


@pytest.mark.parametrize("model", KHEPERAS)
@pytest.mark.parametrize("name", TURRETS)
def test_every_turret_is_listed_by_net(model: str, name: str) -> None:
    assert any(
        pair.request == b"net" and TURRETS[name].title in line
        for pair in said(model)
        for line in pair.reply
    )


@pytest.mark.parametrize("model", KHEPERAS)
def test_every_switch_is_turned(model: str) -> None:
    urls = [url_of(path.read_text()) for path in FILES if f"{model}-choices" in path.stem]
    assert all(f"firmware={name}" in urls[0] for name in option_names())


def test_both_robots_have_the_same_conversations() -> None:
    topics = {
        model: {path.stem.partition("-")[2] for path in FILES if path.stem.split("-")[0] == model}
        for model in KHEPERAS
    }
    assert topics["khepera"] == topics["khepera2"] != set()


PUCKS = {
    "epuck": (GCTRONIC, "model=epuck&", ""),
    "btcom": (BTCOM, "model=epuck&", "profile=btcom"),
    "epuck2": (GCTRONIC2, "model=epuck2&", ""),
}


def said_by_puck(name: str) -> list[Exchange]:
    _, model, profile = PUCKS[name]
    # those of parsers have requests that are swallowed
    texts = [path.read_text() for path in FILES if not path.stem.endswith("-parser")]
    mine = [
        text
        for text in texts
        if model in (url := text.partition("\n")[0])
        and (profile in url if profile else "profile=" not in url)
    ]
    return [pair for text in mine for pair in exchanges(text)]


@pytest.mark.parametrize("name", PUCKS)
def test_every_letter_of_an_epuck_occurs_with_its_own_reply(name: str) -> None:
    generation = PUCKS[name][0]
    answered, silent = set(), set()
    for pair in said_by_puck(name):
        letter = pair.request[:1].decode("latin-1")
        if letter not in generation.letters:
            continue
        if not pair.reply:
            silent.add(letter)
        elif letter == "H" or pair.reply[0][:1] == letter.lower():
            answered.add(letter)
    assert answered == generation.letters - generation.silent - {"Z"}
    assert silent >= generation.silent | ({"Z"} & generation.letters)


@pytest.mark.parametrize("name", PUCKS)
def test_every_binary_command_of_an_epuck_occurs_with_an_answer_of_its_size(name: str) -> None:
    codes = PUCKS[name][0].codes
    found = set()
    for pair in said_by_puck(name):
        code = codes.get(pair.request[0]) if pair.request else None
        if code is None or len(pair.request) != 2 + code.parameters or pair.request[-1]:
            continue
        size = len(bytes.fromhex("".join(line for line in pair.reply if "bytes" not in line)))
        if code.name in "UI" and code.answer != 0:  # sizes of their own
            assert size >= 3
        else:
            assert size == code.answer
        found.add(code.byte)
    assert found == set(codes)
