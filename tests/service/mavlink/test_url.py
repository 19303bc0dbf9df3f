"""Addresses of links."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import BadInput
from service.mavlink.url import LinkKind, LinkUrl, parse_url


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin://0.0.0.0:14540", LinkUrl(LinkKind.UDP_IN, "0.0.0.0", 14540)),
        ("udpin:127.0.0.1:0", LinkUrl(LinkKind.UDP_IN, "127.0.0.1", 0)),
        ("udpout://drone.local:14550", LinkUrl(LinkKind.UDP_OUT, "drone.local", 14550)),
        ("udpout:10.0.0.2:14550", LinkUrl(LinkKind.UDP_OUT, "10.0.0.2", 14550)),
        ("tcp:127.0.0.1:5760", LinkUrl(LinkKind.TCP_OUT, "127.0.0.1", 5760)),
        ("tcpout://127.0.0.1:5760", LinkUrl(LinkKind.TCP_OUT, "127.0.0.1", 5760)),
        ("tcpin://[::1]:5790", LinkUrl(LinkKind.TCP_IN, "::1", 5790)),
        ("serial:///dev/ttyACM0:921600", LinkUrl(LinkKind.SERIAL, "/dev/ttyACM0", 921600)),
        ("serial://COM3:57600", LinkUrl(LinkKind.SERIAL, "COM3", 57600)),
    ],
)
def test_both_spellings_are_read(text: str, url: LinkUrl) -> None:
    assert parse_url(text) == url
    assert parse_url(str(url)) == url


@pytest.mark.parametrize(
    "text",
    [
        "",
        "14540",
        "udp://0.0.0.0:14540",
        "http://127.0.0.1:80",
        "udpin://0.0.0.0",
        "udpin://:14540",
        "udpin://0.0.0.0:port",
        "udpin://0.0.0.0:70000",
        "udpout://127.0.0.1:0",
        "tcpout://127.0.0.1:-1",
        "serial:///dev/ttyACM0",
        "serial://:57600",
        "serial:///dev/ttyACM0:5",
        "udpin://a b:14540",
        "udpin://0.0.0.0:\u0661\u0662",
    ],
)
def test_bad_address_is_one_sentence_that_names_it_and_what_would_be_right(text: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_url(text)
    message = str(caught.value)
    assert repr(text) in message
    assert "udpin://" in message
    assert "\n" not in message


@given(st.text())
def test_any_text_is_an_address_or_bad_input(text: str) -> None:
    try:
        url = parse_url(text)
    except BadInput:
        return
    assert parse_url(str(url)) == url
