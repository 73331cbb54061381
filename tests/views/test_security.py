# SPDX-License-Identifier: Apache-2.0
"""Without the token nothing is given; foreign pages and foreign names are refused."""

import http.client
import json

import pytest
from conftest import TOKEN, Server
from driveid.views.workbench.projects import Project

PATHS = ["/", "/live", "/compare", "/falls", "/api/known", "/api/project?p=x", "/api/export/model.toml?p=x", "/static/app.js", "/static/driveid.css", "/nothing"]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    record = folder / "r.csv"
    record.write_text("t_s,u,y\n" + "".join(f"{k / 1000},{k % 7},{k % 5}\n" for k in range(100)))
    server = Server(Project("test", 'format = 1\nstructure = "lti"\n', (str(record),)), "/tmp/driveid-nobody.sock", folder)
    yield server
    server.stop()


def ask(server, path, method="GET", body=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request(method, path, body, {"Host": f"127.0.0.1:{server.port}", **{k.replace("_", "-"): v for k, v in headers.items()}})
    answer = connection.getresponse()
    return answer, answer.read()


def cookie(server):
    return f"driveid_{server.port}={TOKEN}"


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("headers", [{}, {"Cookie": "driveid=wrong"}, {"Cookie": "driveid_PORT=" + TOKEN[:-1]}, {"Cookie": "driveid_PORT="}])
def test_wrong_or_no_token_gets_nothing(server, path, headers):
    headers = {k: v.replace("PORT", str(server.port)) for k, v in headers.items()}
    answer, body = ask(server, path, **headers)
    assert answer.status == 403 and b"token" in body and len(body) < 200 and not answer.getheader("Set-Cookie")
    answer, _ = ask(server, path + ("&" if "?" in path else "?") + "token=wrong", **headers)
    assert answer.status == 403


def test_token_becomes_a_cookie_and_leaves_the_address(server):
    answer, _ = ask(server, f"/compare?p=abc&token={TOKEN}")
    assert answer.status == 303 and answer.getheader("Location") == "/compare?p=abc"
    kept = answer.getheader("Set-Cookie")
    assert "HttpOnly" in kept and "SameSite=Strict" in kept
    answer, body = ask(server, "/static/app.js", Cookie=kept.split(";")[0])
    assert answer.status == 200 and b"SPDX" in body and "frame-ancestors 'none'" in answer.getheader("Content-Security-Policy")


@pytest.mark.parametrize("headers", [{"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "127.0.0.1"}])
def test_foreign_names_and_pages_are_refused_even_with_the_token(server, headers):
    answer, _ = ask(server, "/api/known", Cookie=cookie(server), **headers)
    assert answer.status == 403


def test_socket_needs_cookie_and_origin(server):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    url, origin = f"ws://127.0.0.1:{server.port}/ws/live", server.base
    for options in ({}, {"origin": origin}, {"additional_headers": {"Cookie": cookie(server)}}, {"origin": "http://evil.example", "additional_headers": {"Cookie": cookie(server)}}):
        with pytest.raises(InvalidStatus):
            connect(url, **options)
    with connect(url, origin=origin, additional_headers={"Cookie": cookie(server)}) as socket:
        assert b"panel" in socket.recv(5)


def test_path_traversal_in_static_is_refused(server):
    for path in ("/static/../projects.py", "/static/%2e%2e/report.py", "/static//etc/passwd"):
        answer, _ = ask(server, path, Cookie=cookie(server))
        assert answer.status in (404, 405)


@pytest.mark.parametrize("path", ["/api/trace?p=ID&t0=x&t1=1", "/api/trace?p=ID", "/api/project?p=zzz", "/api/where?p=ID&r=99", "/api/export/nothing?p=ID", "/api/falls?p=ID&add=no_such_effect"])
def test_bad_questions_get_a_sentence(server, path):
    import time
    for _ in range(100):
        answer, body = ask(server, path.replace("ID", server.project.id), Cookie=cookie(server))
        if answer.status != 202:
            break
        time.sleep(0.1)
    assert answer.status == 422 and json.loads(body)["message"]


def test_open_names_the_file_that_is_not_there(server):
    body = json.dumps({"training": "/no/such/run.csv", "structure": "rigid_axis", "given": "K_t_Nm_A=0.05"})
    answer, text = ask(server, "/api/open", "POST", body, Cookie=cookie(server), Origin=server.base)
    assert answer.status == 422 and "/no/such/run.csv" in json.loads(text)["message"]
