"""Only who has the address of the window sees it, and nobody who sees it can disturb it or the others."""

import http.client
import json
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from hric_core.errors import FailureError, HricError
from hric_view.server import MAX_MESSAGE, MAX_VIEWERS, PORT, ForeignMessageError, Viewer, ViewServer, Visit, WebPage

SCENE = '{"data":{}}'


class Shown:
    """Window with one page, which says the address of its socket."""

    def page(self, visit: Visit) -> WebPage | None:
        return WebPage("text/html", f"<p>{visit.socket}".encode()) if visit.path == "/" else None

    def scene(self, visit: Visit) -> str:
        if "run" in visit.query:
            raise HricError(f"no run {visit.query['run']!r}")
        return SCENE


class Obeying:
    """Receiver that keeps what it gets."""

    def __init__(self) -> None:
        self.received: list[object] = []
        self.left: list[str] = []

    def receive(self, viewer: Viewer, message: Mapping[str, object]) -> None:
        if "do" not in message:
            raise ForeignMessageError("nothing to do")
        if message["do"] == "forbidden":
            raise HricError("not now")
        self.received.append(message)
        viewer.tell({"type": "done"})

    def leave(self, viewer: Viewer) -> None:
        self.left.append(viewer.name)


@pytest.fixture
def server() -> Iterator[ViewServer]:
    made = ViewServer(Shown())
    yield made
    made.close()


def get(server: ViewServer, path: str, **headers: str) -> tuple[int, str]:
    address = urlsplit(server.address)
    client = http.client.HTTPConnection(str(address.hostname), address.port, timeout=10)
    client.request("GET", path, headers=headers)
    answer = client.getresponse()
    return answer.status, answer.read().decode()


def viewer(server: ViewServer, origin: str | None = "", token: str | None = None, host: str = "") -> ClientConnection:
    """Connect as the page does, or as somebody else; origin: "": that of the page."""
    address = urlsplit(server.address)
    query = address.query if token is None else f"token={token}"
    return connect(
        f"ws://{address.netloc}/socket?{query}",
        origin=f"http://{address.netloc}" if origin == "" else origin,  # type: ignore[arg-type]
        additional_headers={"Host": host} if host else None,
        open_timeout=10,
        close_timeout=0.1,
    )


def test_the_printed_address_has_the_page_of_its_own_socket(server: ViewServer) -> None:
    address = urlsplit(server.address)
    assert address.hostname == "127.0.0.1"
    assert get(server, f"/?{address.query}") == (200, f"<p>ws://{address.netloc}")


@pytest.mark.parametrize(
    "query", ["", "?token=", "?token=AAAAAAAAAAAAAAAAAAAAAA", "?token=%E4%BA%BA", "?token=a&token=b"]
)
@pytest.mark.parametrize("path", ["/", "/socket", "/else"])
def test_without_the_token_there_is_no_page(server: ViewServer, path: str, query: str) -> None:
    status, text = get(server, path + query)
    assert status == 403 and "token" in text


def test_another_path_has_nothing(server: ViewServer) -> None:
    assert get(server, f"/else?{urlsplit(server.address).query}")[0] == 404


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "evil.example:{port}", ""])
def test_another_name_of_this_host_is_refused(server: ViewServer, host: str) -> None:
    address = urlsplit(server.address)
    assert get(server, f"/?{address.query}", Host=host.format(port=address.port))[0] == 403


def test_a_viewer_gets_scene_and_frames(server: ViewServer) -> None:
    with viewer(server) as client:
        assert client.recv(10) == SCENE
        server.send("1")
        assert client.recv(10) == "1"
        server.send("2")
        assert client.recv(10) == "2"


@pytest.mark.parametrize(
    "origin", [None, "null", "http://evil.example", "https://127.0.0.1", "http://127.0.0.1.evil.example"]
)
def test_a_page_of_another_origin_is_refused(server: ViewServer, origin: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused:
        viewer(server, origin)
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("token", ["", "wrong"])
def test_a_socket_without_the_token_is_refused(server: ViewServer, token: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        viewer(server, token=token)
    assert refused.value.response.status_code == 403


def test_the_token_of_a_server_before_is_refused(server: ViewServer) -> None:
    before = ViewServer(Shown())
    token = urlsplit(before.address).query.removeprefix("token=")
    before.close()
    with pytest.raises(InvalidStatus):
        viewer(server, token=token)


LONG = ["x" * MAX_MESSAGE, "x" * (MAX_MESSAGE + 1), "x" * 10**6, b"x" * 10**5, '{"a":' * 800, "-" * 4000]
MESSAGES = [
    *("", "{", "[]", "null", '{"do":"pause"}', b"", b"\x00\xff", "\u0000", "1e999", "NaN", '{"do":["rm"]}', "<script>"),
    *("\U0001f600", '{"do":"stop","do":"start"}', *LONG),
]


@pytest.mark.parametrize("message", MESSAGES, ids=[f"bad{number}" for number in range(len(MESSAGES))])
def test_who_sends_anything_is_disconnected_and_the_others_are_not(server: ViewServer, message: str | bytes) -> None:
    with viewer(server) as good, viewer(server) as bad:
        assert good.recv(10) == bad.recv(10) == SCENE
        with pytest.raises(ConnectionClosed) as closed:
            bad.send(message)
            for _ in range(100):
                bad.recv(10)
        assert closed.value.rcvd is not None and closed.value.rcvd.code in (1008, 1009)
        server.send("1")
        assert good.recv(10) == "1"


def test_a_viewer_that_does_not_read_delays_nobody(server: ViewServer) -> None:
    with viewer(server) as stuck, viewer(server) as good:
        assert stuck.recv(10) == good.recv(10) == SCENE
        large = "x" * 10**6
        for number in range(60):
            server.send(f"{number} {large}")
            assert str(good.recv(10)).startswith(f"{number} ")


def test_more_viewers_than_allowed_are_refused(server: ViewServer) -> None:
    with ExitStack() as stack:
        clients = [stack.enter_context(viewer(server)) for _ in range(MAX_VIEWERS)]
        assert [client.recv(10) for client in clients] == [SCENE] * MAX_VIEWERS
        with pytest.raises(InvalidStatus) as refused:
            viewer(server)
        assert refused.value.response.status_code == 503


def test_who_has_left_is_no_viewer(server: ViewServer) -> None:
    with viewer(server) as client:
        client.recv(10)
        assert server.viewers == 1
    with viewer(server) as client:
        client.recv(10)
        latest = time.monotonic() + 10.0
        while server.viewers > 1 and time.monotonic() < latest:
            time.sleep(0.01)
        assert server.viewers == 1


def test_without_a_port_the_usual_one_or_a_free_one() -> None:
    first, second = ViewServer(Shown()), ViewServer(Shown())
    assert {urlsplit(made.address).port for made in (first, second)} != {PORT}
    for made in (first, second):
        assert get(made, f"/?{urlsplit(made.address).query}")[0] == 200
        made.close()


def test_a_taken_port_is_an_error_with_the_way_out(server: ViewServer) -> None:
    with pytest.raises(FailureError, match="in use; valid: an address of this machine and a free port, or port 0"):
        ViewServer(Shown(), port=int(urlsplit(server.address).port or 0))


@pytest.mark.parametrize(
    ("host", "text"), [("0.0.0.0", "valid: one of them"), ("nowhere.invalid", "valid: an address")]
)
def test_another_host_is_an_error_with_the_way_out(host: str, text: str) -> None:
    with pytest.raises(FailureError, match=text) as refused:
        ViewServer(Shown(), host)
    assert "Unknown error" not in str(refused.value)


def test_closing_ends_the_connections(server: ViewServer) -> None:
    made = ViewServer(Shown())
    with viewer(made) as client:
        client.recv(10)
        made.close()
        with pytest.raises(ConnectionClosed):
            client.recv(10)


@pytest.fixture
def receiver() -> Obeying:
    return Obeying()


@pytest.fixture
def controlled(receiver: Obeying) -> Iterator[ViewServer]:
    made = ViewServer(Shown(), receiver=receiver)
    yield made
    made.close()


def test_messages_reach_the_receiver_until_viewer_leaves(controlled: ViewServer, receiver: Obeying) -> None:
    with viewer(controlled) as client:
        client.recv(10)
        client.send('{"do":"pause","a":[1.5]}')
        assert json.loads(client.recv(10)) == {"type": "done"}
        name = ":".join(map(str, client.local_address[:2]))
    controlled.close()
    assert receiver.received == [{"do": "pause", "a": [1.5]}] and receiver.left == [name]


def test_a_refused_message_is_told_with_its_reason(controlled: ViewServer) -> None:
    with viewer(controlled) as client:
        client.recv(10)
        client.send('{"do":"forbidden"}')
        assert json.loads(client.recv(10)) == {"type": "refused", "text": "not now"}
        client.send('{"do":"pause"}')
        assert json.loads(client.recv(10)) == {"type": "done"}


BAD = [text for text in MESSAGES if text not in ('{"do":"pause"}', '{"do":["rm"]}')]


@pytest.mark.parametrize("message", BAD, ids=[f"bad{number}" for number in range(len(BAD))])
def test_a_message_of_no_page_closes_the_connection(controlled: ViewServer, message: str | bytes) -> None:
    with viewer(controlled) as bad, pytest.raises(ConnectionClosed) as closed:
        bad.send(message)
        for _ in range(100):
            bad.recv(10)
    assert closed.value.rcvd is not None and closed.value.rcvd.code in (1008, 1009)
    with viewer(controlled) as good:
        good.recv(10)
        good.send('{"do":"pause"}')
        assert json.loads(good.recv(10)) == {"type": "done"}


def test_a_scene_that_does_not_exist_is_told(server: ViewServer) -> None:
    address = urlsplit(server.address)
    with connect(f"ws://{address.netloc}/socket?{address.query}&run=x", origin=f"http://{address.netloc}") as client:  # type: ignore[arg-type]
        assert json.loads(client.recv(10)) == {"type": "refused", "text": "no run 'x'"}
