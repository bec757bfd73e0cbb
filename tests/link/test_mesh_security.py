"""The encrypted mesh: who has the right certificate speaks; everybody else is refused, named and counted."""

from __future__ import annotations

import shutil
import socket
import ssl
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from ftcc.link.mesh_authority import add_certificates
from ftcc.link.mesh_refusals import Refusal
from ftcc.link.mesh_security import Credentials, MeshKeysError, access_control, lead_access, node_access, uav_access
from tests.link.secured import Process
from tests.support.ports import free_port


def open_pair(one: Process, two: Process, keys: Path) -> int:
    """UAVs 1 and 2, who hear each other; the port on which UAV 1 listens."""
    port, good = free_port(), str(keys / "good")
    one("open", keys=good, name="uav-1", own=1, hears=[2], heard_by=[2], listen=port)
    two("open", keys=good, name="uav-2", own=2, hears=[1], heard_by=[1], connect=[port])
    assert one("wait_until_ready", seconds=10.0)
    assert two("wait_until_ready", seconds=10.0)
    return port


def call(port: int, keys: Path | None, name: str) -> str:
    """Call by TLS, trusting anybody, with a certificate or without; how it ended."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    if keys is not None:
        context.load_cert_chain(keys / f"{name}.crt", keys / f"{name}.key")
    with socket.create_connection(("127.0.0.1", port), timeout=5.0) as plain:
        try:
            with context.wrap_socket(plain) as secured:
                # In TLS 1.3 a client that is refused learns so only when it reads.
                return "closed" if not secured.recv(1) else "answered"
        except (ssl.SSLError, ConnectionError, TimeoutError) as error:
            return type(error).__name__


def test_the_right_certificates_speak_and_nobody_is_refused(start, keys):
    one, two = start(), start()
    open_pair(one, two, keys)
    one("publish", text="from one")
    two("publish", text="from two")
    assert two("receive", count=1, seconds=5.0) == [[1, "from one"]]
    assert one("receive", count=1, seconds=5.0) == [[2, "from two"]]
    assert (one("links"), two("links")) == (["uav-2"], ["uav-1"])
    one("say", text="said beside it")
    assert (one("close"), two("close")) == ([], [])
    assert "said beside it" in one.log.read_text()


def test_callers_without_a_right_certificate_are_refused_and_counted_by_reason(start, keys):
    one, two = start(), start()
    port = open_pair(one, two, keys)
    assert call(port, None, "") != "answered"
    assert one("refused", seconds=5.0, reason="no certificate") == [["no certificate", "unknown caller", 1]]
    for _ in range(2):
        assert call(port, keys / "foreign", "uav-2") != "answered"
    counts = one("refused", seconds=0.5)
    assert counts == [["certificate of another authority", "unknown caller", 2]]
    assert call(port, keys / "expired", "uav-2") != "answered"
    assert one("refused", seconds=5.0, reason="expired") == [["expired certificate", "unknown caller", 1]]
    assert call(port, keys / "early", "uav-2") != "answered"
    assert one("refused", seconds=5.0, reason="yet") == [["certificate not valid yet", "unknown caller", 1]]
    with socket.create_connection(("127.0.0.1", port)) as junk:
        junk.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert one("refused", seconds=5.0, reason="TLS") == [["does not speak TLS", "unknown caller", 1]]
    one("publish", text="still")
    assert two("receive", count=1, seconds=5.0) == [[1, "still"]], "the link of those who belong to it stands"


def test_peers_with_wrong_keys_do_not_link_and_both_ends_say_why(start, keys):
    listening, foreign, plain = start(), start(), start()
    port = free_port()
    there = {"own": 2, "hears": [1], "heard_by": [1], "connect": [port], "name": "uav-2"}
    listening("open", keys=str(keys / "good"), name="uav-1", own=1, hears=[2], heard_by=[2], listen=port)
    foreign("open", keys=str(keys / "foreign"), **there)
    endpoint = f"tls/127.0.0.1:{port}"
    seen = foreign("refused", seconds=5.0, reason="another authority")
    assert [one[:2] for one in seen] == [["certificate of another authority", endpoint]]
    seen = listening("refused", seconds=5.0, reason="authority")
    assert [one[:2] for one in seen] == [["does not accept our authority", "unknown caller"]]
    foreign.kill()
    plain("open", keys="", scheme="tcp", **there)
    seen = listening("refused", seconds=5.0, reason="TLS")
    assert ["does not speak TLS", "unknown caller"] in [one[:2] for one in seen]
    assert listening("links") == plain("links") == []
    assert not listening("wait_until_ready", seconds=0.0)


def test_a_certificate_of_another_uav_links_but_is_neither_heard_nor_told(start, keys):
    """UAV 7's certificate in a process that calls itself 3, under no rules but those of the others."""
    one, thief = start(), start()
    port, good = free_port(), str(keys / "good")
    one("open", keys=good, name="uav-1", own=1, hears=[3], heard_by=[3], listen=port)
    thief("open", keys=good, name="uav-7", own=3, hears=[1], heard_by=[1], connect=[port], lawless=True)
    seen = {(reason, who) for reason, who, _ in one("refused", seconds=5.0, reason="announce")}
    if not any("rights" in reason for reason, _ in seen):  # Zenoh tells of its link and of its token in either order
        seen |= {(reason, who) for reason, who, _ in one("refused", seconds=5.0, reason="rights")}
    assert ("has no rights here", "uav-7 at 127.0.0.1") in seen
    assert ("may not announce ftcc/run/3/hears/1", "uav-7") in seen
    assert one("links") == ["uav-7"]
    thief("publish", text="I am 3")
    one("publish", text="to 3 alone")
    assert one("receive", count=1, seconds=0.3) == []
    assert thief("receive", count=1, seconds=0.1) == []
    assert not one("wait_until_ready", seconds=0.0)


def test_who_was_refused_is_named_also_if_zenoh_tells_of_its_link_later(start, keys):
    one = start()
    one("open", keys=str(keys / "good"), name="uav-1", own=1, hears=[], heard_by=[7], listen=free_port())
    before, after = one("refused_before_its_link", key="ftcc/run/3/shared", name="uav-7")
    assert before == []
    assert after == [["may not put ftcc/run/3/shared", "uav-7", 1]]


def test_a_neighbour_that_puts_what_is_anothers_is_not_heard_but_named_and_counted(start, keys):
    """Even where Zenoh's sender does send: the receiver lets it know what it listens to."""
    one, seven = start(), start()
    port, good = free_port(), str(keys / "good")
    rights = {
        "uav-7": {
            "hears": ["ftcc/run/7/shared"],
            "asks": ["ftcc/run/*/shared"],
            "answers": ["ftcc/run/*/hears/7"],
        }
    }
    one("open_for", keys=good, name="uav-1", listen=port, rights=rights, hear="ftcc/run/*/shared")
    seven("open", keys=good, name="uav-7", own=7, hears=[], heard_by=[1], connect=[port], lawless=True)
    until = time.monotonic() + 10.0
    while not one("all_heard") and time.monotonic() < until:
        seven("publish", text="own")
        time.sleep(0.02)
    for _ in range(3):
        seven("put", key="ftcc/run/3/shared", text="evil")
    seven("publish", text="last")
    while "ftcc/run/7/shared last" not in one("all_heard") and time.monotonic() < until:
        time.sleep(0.01)
    assert set(one("all_heard")) == {"ftcc/run/7/shared own", "ftcc/run/7/shared last"}
    assert one("refused", seconds=2.0, reason="put") == [["may not put ftcc/run/3/shared", "uav-7", 3]]


def test_a_recorded_conversation_that_is_sent_again_is_refused(start, keys):
    one, two = start(), start()
    port, middle, good = free_port(), free_port(), str(keys / "good")
    one("open", keys=good, name="uav-1", own=1, hears=[2], heard_by=[2], listen=port)
    recorded: list[bytes] = []
    with socket.create_server(("127.0.0.1", middle)) as door:

        def carry(source: socket.socket, sink: socket.socket, record: bool) -> None:
            while chunk := source.recv(65536):
                if record:
                    recorded.append(chunk)
                sink.sendall(chunk)

        def between() -> None:
            caller, _ = door.accept()
            called = socket.create_connection(("127.0.0.1", port))
            with caller, called:
                back = threading.Thread(target=carry, args=(called, caller, False), daemon=True)
                back.start()
                carry(caller, called, True)
                called.shutdown(socket.SHUT_RDWR)
                back.join()

        thread = threading.Thread(target=between, daemon=True)
        thread.start()
        two("open", keys=good, name="uav-2", own=2, hears=[1], heard_by=[1], connect=[middle])
        assert two("wait_until_ready", seconds=10.0)
        two("publish", text="turn left")
        assert one("receive", count=1, seconds=5.0) == [[2, "turn left"]]
        two.kill()
        thread.join(5.0)
    assert b"turn left" not in b"".join(recorded)
    one("refused", seconds=0.1)
    with socket.create_connection(("127.0.0.1", port)) as again:
        again.sendall(b"".join(recorded))
        seen = one("refused", seconds=5.0, reason="recording")
    assert [who for _, who, _ in seen] == ["unknown caller"]
    assert one("receive", count=1, seconds=0.2) == []


def test_a_link_ends_when_the_certificate_of_its_other_end_does(start, keys, tmp_path):
    short = tmp_path / "short"
    shutil.copytree(keys / "good", short)
    one, two = start(), start()
    port = free_port()
    one("open", keys=str(keys / "good"), name="uav-1", own=1, hears=[2], heard_by=[2], listen=port)
    two("say", text="started")
    add_certificates(short, ["uav-2"], days=3.5 / 86400.0, renew=True)
    two("open", keys=str(short), name="uav-2", own=2, hears=[1], heard_by=[1], connect=[port])
    assert one("wait_until_ready", seconds=10.0)
    assert one("links") == ["uav-2"]
    seen = one("refused", seconds=8.0, reason="expired")
    assert ["expired certificate", "unknown caller"] in [kind[:2] for kind in seen]
    assert one("links") == []


def test_a_flood_needs_neither_memory_nor_log_and_holds_up_no_link(start, keys):
    one, two = start(), start()
    port = open_pair(one, two, keys)
    for _ in range(400):
        with socket.create_connection(("127.0.0.1", port)) as junk:
            junk.sendall(b"junk")
    for n in range(50):
        one("publish", text=str(n))
    assert two("receive", count=50, seconds=5.0) == [[1, str(n)] for n in range(50)]
    kinds, total, told_apart = one("flood", lines=100_000)
    assert total >= 100_000
    assert kinds <= told_apart + 1
    assert one.log.stat().st_size < 10_000


def test_a_flood_of_strangers_does_not_keep_new_links_waiting(start, keys):
    """Behind a door; without it UAV 2 would wait for 0.1 s per stranger."""
    one, two = start(), start()
    port, good = free_port(), str(keys / "good")
    one("open", keys=good, name="uav-1", own=1, hears=[2], heard_by=[2], listen=port)
    one("door", port=port, addresses=["127.0.0.1"])
    strangers = [socket.socket() for _ in range(300)]
    for stranger in strangers:
        stranger.setblocking(False)
        stranger.bind(("127.0.0.2", 0))
        stranger.connect_ex(("127.0.0.1", port))
    two("open", keys=good, name="uav-2", own=2, hears=[1], heard_by=[1], connect=[port])
    assert one("wait_until_ready", seconds=10.0)
    for stranger in strangers:
        stranger.close()
    assert one("dropped") >= len(strangers)
    assert one("refused", seconds=0.3) == []


def test_a_child_of_a_process_that_counts_prints_to_its_own_log(start, keys, tmp_path):
    one, log = start(), tmp_path / "child.log"
    one("open", keys=str(keys / "good"), name="uav-1", own=1, hears=[], heard_by=[], listen=free_port())
    one("say_in_child", text="from the child", log=str(log))
    one("say", text="from the parent")
    assert one("close") == []
    one("say", text="after the end")
    assert log.read_text() == "from the child\n"
    assert one.log.read_text().splitlines() == ["from the parent", "after the end"]


def test_nobody_waits_for_a_counter_that_is_not_asked(start, keys):
    """Zenoh's lines about 10 000 messages are more than the pipe holds."""
    one, two = start(), start()
    open_pair(one, two, keys)
    one("publish_many", count=10_000)
    assert len(two("receive", count=10_000, seconds=20.0)) == 10_000


@pytest.mark.parametrize(
    ("folder", "change", "error"),
    [
        ("nowhere", None, "there is no such folder of keys"),
        ("good", lambda folder: (folder / "uav-2.key").unlink(), "uav-2.key: is missing; certificates there: uav-1"),
        ("good", lambda folder: (folder / "uav-2.crt").unlink(), "uav-2.crt: is missing"),
        ("good", lambda folder: (folder / "uav-2.key").chmod(0o640), "has mode 640, .*chmod 600"),
        ("good", lambda folder: folder.chmod(0o777), "has mode 777, .*chmod 700"),
        ("good", lambda folder: (folder / "uav-2.crt").write_text("?"), "is no certificate"),
        ("good", lambda folder: (folder / "uav-2.key").write_text("?"), "is no private key"),
        ("good", lambda folder: swap(folder, "crt"), "certificate of 'uav-3', not of 'uav-2'"),
        ("good", lambda folder: swap(folder, "key"), "belongs to another certificate"),
        ("expired", None, "has expired at .*--renew"),
        ("early", None, "is valid from .*clock"),
        ("foreign", lambda folder: shutil.copy(folder.parent / "good" / "authority.crt", folder), "another one"),
    ],
)
def test_keys_that_cannot_be_used_are_refused_with_one_line(keys, tmp_path, folder, change, error):
    if (keys / folder).is_dir():
        shutil.copytree(keys / folder, tmp_path / folder)
        shutil.copytree(keys / "good", tmp_path / "good", dirs_exist_ok=True)
    if change is not None:
        change(tmp_path / folder)
    with pytest.raises(MeshKeysError, match=error) as refusal:
        Credentials(tmp_path / folder, "uav-2", "demo")
    assert "\n" not in str(refusal.value)


def swap(folder: Path, suffix: str) -> None:
    """UAV 2 gets a file of UAV 3's."""
    shutil.copy(folder / f"uav-3.{suffix}", folder / f"uav-2.{suffix}")
    if suffix == "crt":
        shutil.copy(folder / "uav-3.key", folder / "uav-2.key")


def test_a_forged_authority_of_the_same_name_is_noticed(keys, tmp_path):
    """Its name is the same, its key is not."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import Encoding

    folder = tmp_path / "forged"
    shutil.copytree(keys / "good", folder)
    true = x509.load_pem_x509_certificate((folder / "authority.crt").read_bytes())
    key = ec.generate_private_key(ec.SECP256R1())
    forged = (
        x509.CertificateBuilder()
        .subject_name(true.subject)
        .issuer_name(true.subject)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(true.not_valid_before_utc)
        .not_valid_after(true.not_valid_after_utc)
        .sign(key, hashes.SHA256())
    )
    (folder / "authority.crt").write_bytes(forged.public_bytes(Encoding.PEM))
    with pytest.raises(MeshKeysError, match="signature is not by this authority"):
        Credentials(folder, "uav-2")


def test_keys_of_another_swarm_are_refused(keys):
    assert Credentials(keys / "good", "lead").swarm == "demo"
    with pytest.raises(MeshKeysError, match="is for swarm 'demo', not 'other'"):
        Credentials(keys / "good", "lead", "other")


def allowed(table: dict[str, Any], name: str, flow: str, message: str) -> set[str]:
    """The key expressions on which access control lets a message of ``name`` through."""
    rules = {rule["id"]: rule for rule in table["rules"]}
    mine = [rules[rule] for policy in table["policies"] if policy["subjects"] == [name] for rule in policy["rules"]]
    return {key for rule in mine if flow in rule["flows"] and message in rule["messages"] for key in rule["key_exprs"]}


def test_a_uav_may_put_its_own_and_to_those_alone_that_hear_it():
    table = access_control(uav_access("run", 2, hears=[1], heard_by=[3]))
    assert (table["enabled"], table["default_permission"]) == (True, "deny")
    assert {rule["permission"] for rule in table["rules"]} == {"allow"}
    assert allowed(table, "uav-1", "ingress", "put") == {"ftcc/run/1/shared"}
    assert allowed(table, "uav-1", "egress", "put") & {"ftcc/run/2/shared"} == set()
    assert "ftcc/run/2/shared" in allowed(table, "uav-3", "egress", "put")
    assert "ftcc/run/3/shared" not in allowed(table, "uav-3", "ingress", "put")
    assert allowed(table, "uav-7", "ingress", "put") == set()


def test_nodes_and_the_lead_publish_below_their_own_names():
    node, lead = access_control(node_access("demo", "a")), access_control(lead_access("demo", ["a", "b"]))
    assert [subject["id"] for subject in node["subjects"]] == ["lead"]
    for flow_out, flow_in, table, other in (("egress", "ingress", node, "lead"), ("ingress", "egress", lead, "node-a")):
        assert allowed(table, other, flow_out, "put") == {"ftcc/demo/node/a/**"}
        assert allowed(table, other, flow_in, "put") == {"ftcc/demo/lead/*", "ftcc/demo/lead/to/a/**"}


def test_refusals_read_as_a_sentence():
    assert Refusal("expired certificate", "uav-3", 1).text == "mesh: uav-3 refused: expired certificate"
    assert (
        Refusal("no certificate", "unknown caller", 4).text == "mesh: unknown caller refused: no certificate, 4 times"
    )
