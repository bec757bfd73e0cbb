"""What makes the mesh encrypted and authenticated: Zenoh's settings for TLS, and who may say what to whom.

Both ends of a link prove by a certificate of the swarm's authority who they are (TLS 1.3). Zenoh's access control then
lets each name through with what belongs to it and denies all else, in both directions; `mesh_keys` makes the keys,
`mesh_refusals` counts those who were refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ftcc.link.mesh_keys import AUTHORITY, LEAD, MeshKeysError, load_checked, node_name, swarm_of, uav_name

__all__ = [
    "Credentials",
    "MeshKeysError",
    "Rights",
    "access_control",
    "lead_access",
    "node_access",
    "security",
    "uav_access",
]

_SAID = ("put", "delete", "liveliness_token", "declare_queryable", "reply")
"""Messages that come from who has a key."""
_ASKED = ("declare_subscriber", "declare_liveliness_subscriber", "liveliness_query", "query")
"""Messages that go to who has a key."""


class Credentials:
    """The certificate and key of a process, checked when they are made.

    Parameters
    ----------
    folder : a folder of `ftcc keys mesh`, or one copied from it with ``--bundle``.
    name : the name in the certificate: "uav-3", "node-a", "lead".
    swarm : the swarm for which the keys must have been made; "" for any.

    Raises
    ------
    MeshKeysError
        If a file is missing, cannot be read or can be by others; the certificate is another's, of another swarm or
        authority, not yet or no longer valid; or the key does not belong to it.
    """

    def __init__(self, folder: Path, name: str, swarm: str = "") -> None:
        certificate = load_checked(folder, name, swarm)
        self.folder = folder.absolute()
        self.name = name
        self.swarm = swarm_of(certificate)
        """The swarm for which the keys were made."""
        self.end = certificate.not_valid_after_utc
        """When the certificate expires, UTC; links end then."""

    def tls(self) -> dict[str, Any]:
        """Zenoh's table ``transport/link/tls``: certificates on both sides, whatever the computers are called."""
        key, certificate = str(self.folder / f"{self.name}.key"), str(self.folder / f"{self.name}.crt")
        return {
            "root_ca_certificate": str(self.folder / f"{AUTHORITY}.crt"),
            "enable_mtls": True,
            "listen_private_key": key,
            "listen_certificate": certificate,
            "connect_private_key": key,
            "connect_certificate": certificate,
            # Names are those of UAVs, not of computers: access control looks at them, on both sides.
            "verify_name_on_connect": False,
            "close_link_on_expiration": True,
        }


class Rights(NamedTuple):
    """What passes between this process and one other, by key expressions; all else is denied."""

    hears: tuple[str, ...] = ()
    """What this process takes from the other: puts, tokens, replies."""
    tells: tuple[str, ...] = ()
    """What this process sends to the other."""
    asks: tuple[str, ...] = ()
    """What this process may subscribe to, or query, at the other; an expression as it is declared."""
    answers: tuple[str, ...] = ()
    """What the other may subscribe to, or query, here."""


def access_control(others: Mapping[str, Rights]) -> dict[str, Any]:
    """Zenoh's table ``access_control``: what may pass, by the name in the other's certificate; nothing of strangers."""
    rules, subjects, policies = [], [], []
    for name, rights in others.items():
        passes = (
            ("hears", "ingress", _SAID, rights.hears),
            ("tells", "egress", _SAID, rights.tells),
            ("asks", "egress", _ASKED, rights.asks),
            ("answers", "ingress", _ASKED, rights.answers),
        )
        own = [
            {
                "id": f"{name} {what}",
                "permission": "allow",
                "flows": [flow],
                "messages": list(messages),
                "key_exprs": list(keys),
            }
            for what, flow, messages, keys in passes
            if keys
        ]
        if own:
            rules += own
            subjects.append({"id": name, "cert_common_names": [name], "link_protocols": ["tls"]})
            policies.append({"rules": [rule["id"] for rule in own], "subjects": [name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def uav_access(swarm: str, own: int, hears: Iterable[int], heard_by: Iterable[int]) -> dict[str, Rights]:
    """What passes between the autopilot process ``own`` and its neighbours; parameters as of `Mesh`."""
    prefix, hears, heard_by = f"ftcc/{swarm}", set(hears), set(heard_by)
    return {
        uav_name(other): Rights(
            hears=(
                *((f"{prefix}/{other}/shared",) if other in hears else ()),
                *((f"{prefix}/{other}/hears/{own}",) if other in heard_by else ()),
            ),
            tells=(
                *((f"{prefix}/{own}/shared",) if other in heard_by else ()),
                *((f"{prefix}/{own}/hears/{other}",) if other in hears else ()),
            ),
            asks=(
                *((f"{prefix}/{other}/shared",) if other in hears else ()),
                # A peer declares its subscription to tokens to all: to be denied it would be no refusal of anybody.
                f"{prefix}/*/hears/{own}",
            ),
            answers=(
                *((f"{prefix}/{own}/shared",) if other in heard_by else ()),
                f"{prefix}/*/hears/{other}",
            ),
        )
        for other in sorted(hears | heard_by)
    }


def node_access(swarm: str, own: str) -> dict[str, Rights]:
    """What passes between the node ``own`` and the lead; nodes have no links to each other.

    A node publishes below ``ftcc/SWARM/node/NAME``. The lead publishes for it below ``ftcc/SWARM/lead/to/NAME``, and
    for all as ``ftcc/SWARM/lead/*``.
    """
    lead, node = _branches(swarm, own)
    return {LEAD: Rights(hears=lead, tells=node, asks=lead, answers=(f"ftcc/{swarm}/node/**",))}


def lead_access(swarm: str, nodes: Iterable[str]) -> dict[str, Rights]:
    """What passes between the lead and the nodes, see `node_access`."""
    return {
        node_name(own): Rights(hears=node, tells=lead, asks=(f"ftcc/{swarm}/node/**",), answers=lead)
        for own in nodes
        for lead, node in (_branches(swarm, own),)
    }


def security(credentials: Credentials, others: Mapping[str, Rights]) -> dict[str, Any]:
    """Zenoh's settings of a secured peer: what `Mesh` takes as ``security``."""
    return {
        "transport": {"link": {"tls": credentials.tls(), "protocols": ["tls"]}},
        "access_control": access_control(others),
    }


def _branches(swarm: str, node: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The keys of what the lead publishes for a node, and of what the node publishes."""
    return (f"ftcc/{swarm}/lead/*", f"ftcc/{swarm}/lead/to/{node}/**"), (f"ftcc/{swarm}/node/{node}/**",)
