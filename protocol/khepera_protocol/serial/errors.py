"""Errors of the protocol, told apart by whose fault they are.

ProtocolError
 +-- RequestError   the request cannot be understood; carries the line that a Khepera answers
 +-- ReplyError     the reply is not what the request calls for
"""


class ProtocolError(Exception):
    """Something on the line does not follow the Khepera protocol."""


class RequestError(ProtocolError):
    """The sender's fault: a request that a Khepera refuses.

    Attributes:
        reply: what the robot answers, without the line end.
    """

    def __init__(self, reply: str, reason: str) -> None:
        super().__init__(reason)
        self.reply = reply


class ReplyError(ProtocolError):
    """The robot's fault, or the line's: a reply that does not belong to its request.

    Attributes:
        request: the request as it was sent.
        received: the line that came back.
    """

    def __init__(self, request: bytes, received: bytes, reason: str) -> None:
        super().__init__(f"sent {request!r}, received {received!r}: {reason}")
        self.request = request
        self.received = received
