"""Tells apart why nobody at a Zenoh endpoint answers, which Zenoh calls a time-out in every case.

The endpoint is tried once more without Zenoh: is the port open, and do the certificates suit?
"""

import socket
import ssl
from typing import Final

TLS: Final = "transport/link/tls"
"""Place of the settings below in a configuration."""

Tls = dict[str, object]
"""Those settings."""

_PATIENCE: Final = 2.0
"""Seconds that a connection or a handshake may take."""

_STREAMS: Final = ("tcp", "tls", "ws")
"""Protocols of endpoints that are TCP below."""


def reason_of_silence(endpoint: str, tls: Tls) -> str:
    """Return why a connection to an endpoint such as `tls/127.0.0.1:7446` does not come about."""
    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.partition("#")[0].partition("?")[0].rpartition(":")
    host = host.strip("[]")
    if protocol not in _STREAMS or not port.isdecimal() or int(port) > 65535:
        return f"{endpoint} does not answer"
    try:
        with socket.create_connection((host, int(port)), _PATIENCE) as connection:
            if protocol == "tls":
                return f"{endpoint}: {_reason_of_tls(connection, host, tls)}"
    except TimeoutError:
        return (
            f"{endpoint}: no answer; is it the right address, and does a firewall let you through?"
        )
    except ConnectionRefusedError:
        return f"nobody listens on {endpoint}; start the router first, or correct the port"
    except OSError as error:
        return f"{endpoint}: {error.strerror or error}"
    return (
        f"a program listens on {endpoint}, and does not let this one in; is it a Zenoh router, and"
        " is this the protocol that it speaks?"
    )


def _reason_of_tls(connection: socket.socket, host: str, tls: Tls) -> str:
    """Return what is wrong with the certificates of either side, as a handshake shows it."""
    authority = tls.get("root_ca_certificate")
    own, key = tls.get("connect_certificate"), tls.get("connect_private_key")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = tls.get("verify_name_on_connect") is not False
    try:
        if isinstance(authority, str):
            context.load_verify_locations(authority)
    except ssl.SSLError:
        return f"root_ca_certificate, {authority}, holds no certificate"
    try:
        if isinstance(own, str) and isinstance(key, str):
            context.load_cert_chain(own, key)
    except ssl.SSLError as error:
        pair = f"connect_certificate, {own}, and connect_private_key, {key},"
        return f"{pair} are no pair ({_said(error)})"
    try:
        with context.wrap_socket(connection, server_hostname=host) as secured:
            secured.recv(1)  # a server that refuses this side's certificate says so only now
    except ssl.SSLCertVerificationError as error:
        return (
            f"its certificate is not to be trusted by root_ca_certificate, {authority}:"
            f" {error.verify_message}"
        )
    except TimeoutError:
        pass
    except ssl.SSLError as error:
        if "ALERT" in (error.reason or ""):
            mine = f"this program's certificate, {own}," if own else "a program without certificate"
            return f"the other side refuses {mine} ({_said(error)})"
        return f"what listens there does not speak TLS ({_said(error)})"
    except OSError:
        pass
    return "the certificates of both sides are good, but Zenoh does not get through"


def _said(error: ssl.SSLError) -> str:
    return (error.reason or str(error)).lower().replace("_", " ")
