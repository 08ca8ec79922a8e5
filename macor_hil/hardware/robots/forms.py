"""All kinds of robots that watchers know, by the names in samples."""

from functools import cache
from typing import Final

from khepera_protocol.registry import Registry, is_own_code
from khepera_protocol.zenoh.payloads import USUAL_ROBOT

from macor_hil.hardware.robots.form import Form

FORMS: Final = Registry(
    "kind of robot to watch",
    "khepera_macor.forms",
    {
        "khepera": "macor_hil.hardware.robots.khepera.form:KHEPERA",
        "epuck": "macor_hil.hardware.robots.epuck.form:EPUCK",
    },
)


@cache
def _known(name: str) -> Form:
    form: Form = FORMS.find(name)
    return form


def form_of(kind: str) -> Form:
    """Return the form of a kind; one that nobody here knows is drawn as the usual robot.

    A name from a sample never loads code that is not installed.
    """
    known = not is_own_code(kind) and kind in FORMS.names()
    return _known(kind if known else USUAL_ROBOT)
