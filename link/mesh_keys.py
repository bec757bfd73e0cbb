"""Keys of an encrypted mesh: a folder with an authority, and a certificate for each UAV, each node and the lead.

Files, all of mode 600 in a folder of mode 700: ``authority.crt``; ``authority.key``, only where certificates are made;
``NAME.crt`` and ``NAME.key`` for each name, such as ``uav-3``, ``node-a``, ``lead``. The name is the certificate's
common name, the swarm its organisation. Keys are ECDSA on P-256, which TLS 1.3 has everywhere.

`cryptography` is loaded when the first function is called: processes of swarms without encryption do not need it.
"""

from __future__ import annotations

import datetime
import re
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.x509 import Certificate

__all__ = [
    "AUTHORITY",
    "DAYS",
    "LEAD",
    "NAME",
    "MeshKeysError",
    "Validity",
    "load_certificate",
    "load_checked",
    "load_key",
    "names_in",
    "node_name",
    "now",
    "require_match",
    "require_valid",
    "require_word",
    "swarm_of",
    "uav_name",
]

AUTHORITY = "authority"
"""Name of the authority's files."""
LEAD = "lead"
"""Name of the computer that leads a flight."""
DAYS = 365.0
"""For how long a certificate is valid unless told otherwise, days."""

_NAMED = 8
"""Names that a message lists."""
_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,31}")
"""What may stand in the key of a mesh and in the name of a file."""
NAME = re.compile(rf"uav-[1-9][0-9]{{0,4}}|node-{_WORD.pattern}|{LEAD}")
"""A name of a certificate."""


class MeshKeysError(ValueError):
    """Keys that cannot be used, made or copied; one line: what, where, what would be right."""


class Validity(NamedTuple):
    """From when until when a certificate is valid, UTC."""

    begin: datetime.datetime
    end: datetime.datetime


def uav_name(uav: int) -> str:
    """The name of a UAV's certificate; a process with several UAVs has that of the first."""
    return f"uav-{uav}"


def node_name(node: str) -> str:
    """The name of a node's certificate."""
    return f"node-{node}"


def names_in(folder: Path) -> list[str]:
    """The names that have a certificate in a folder, without the authority; UAVs by number, then the others."""
    names = [path.stem for path in folder.glob("*.crt") if NAME.fullmatch(path.stem)]
    return sorted(names, key=lambda name: (not name.startswith("uav-"), len(name), name))


def load_certificate(folder: Path, name: str) -> Certificate:
    """A certificate of a folder, unchecked but for the mode of its file.

    Raises
    ------
    MeshKeysError
        If it is missing, cannot be read, or others may read or write it.
    """
    from cryptography import x509

    path = folder / f"{name}.crt"
    text = _read(folder, path)
    try:
        return x509.load_pem_x509_certificate(text)
    except ValueError:
        raise MeshKeysError(f"{path}: is no certificate; `ftcc keys mesh` makes them") from None


def load_checked(folder: Path, name: str, swarm: str = "") -> Certificate:
    """The certificate ``name`` of a folder, once it and its key can be used: see `Credentials`.

    Raises
    ------
    MeshKeysError
        The first of: missing, unreadable, read by others; another name or swarm; another authority; not yet or no
        longer valid; a key that does not belong to it.
    """
    authority = load_certificate(folder, AUTHORITY)
    certificate = load_certificate(folder, name)
    key = load_key(folder, name)
    path = folder / f"{name}.crt"
    try:
        certificate.verify_directly_issued_by(authority)
    except Exception as error:  # ValueError, TypeError or InvalidSignature, by what does not fit
        why = "its authority is another one" if str(error) else "its signature is not by this authority"
        raise MeshKeysError(
            f"{path}: was not made by {folder / AUTHORITY}.crt: {why}; take both from one folder of `ftcc keys mesh`"
        ) from None
    if (found := _attribute(certificate, "common name")) != name:
        raise MeshKeysError(f"{path}: is the certificate of {found!r}, not of {name!r}; it was copied or renamed")
    for one, where in ((authority, AUTHORITY), (certificate, name)):
        if swarm and (found := swarm_of(one)) != swarm:
            raise MeshKeysError(f"{folder / where}.crt: is for swarm {found!r}, not {swarm!r}; give the other's folder")
        require_valid(folder, where, one)
    require_match(folder, name, certificate, key)
    return certificate


def require_valid(folder: Path, name: str, certificate: Certificate) -> None:
    """Refuse a certificate before or after its time.

    Raises
    ------
    MeshKeysError
    """
    begin, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    path = folder / f"{name}.crt"
    if now() < begin:
        raise MeshKeysError(f"{path}: is valid from {begin:%Y-%m-%d %H:%M:%S} UTC on; check this computer's clock")
    if now() > end:
        remedy = "make a new folder" if name == AUTHORITY else "`ftcc keys mesh DIR --renew` makes a new one"
        raise MeshKeysError(f"{path}: has expired at {end:%Y-%m-%d %H:%M:%S} UTC; {remedy}")


def swarm_of(certificate: Certificate) -> str:
    """The swarm for which a certificate was made."""
    return _attribute(certificate, "organisation")


def require_word(word: str, what: str) -> None:
    """Refuse a name of a swarm or node that cannot stand in a mesh key.

    Raises
    ------
    MeshKeysError
    """
    if not _WORD.fullmatch(word):
        raise MeshKeysError(
            f"{word!r} will not do as {what}: at most 32 letters, digits, '.', '_' and '-', the first a letter or digit"
        )


def now() -> datetime.datetime:
    """The time, UTC."""
    return datetime.datetime.now(datetime.UTC)


def _attribute(certificate: Certificate, which: str) -> str:
    from cryptography.x509.oid import NameOID

    kind = NameOID.COMMON_NAME if which == "common name" else NameOID.ORGANIZATION_NAME
    found = certificate.subject.get_attributes_for_oid(kind)
    return str(found[0].value) if found else ""


def _read(folder: Path, path: Path) -> bytes:
    """A file that belongs to the user alone."""
    try:
        mode = path.stat().st_mode
        content = path.read_bytes()
    except FileNotFoundError:
        raise MeshKeysError(_missing(folder, path)) from None
    except OSError as error:
        raise MeshKeysError(f"{path}: cannot be read: {error.strerror or error}") from None
    if stat.S_IMODE(mode) & 0o177:
        raise MeshKeysError(
            f"{path}: has mode {stat.S_IMODE(mode):o}, others must have no part in it: chmod 600 {path}"
        )
    if (loose := stat.S_IMODE(folder.stat().st_mode)) & 0o022:
        raise MeshKeysError(f"{folder}: has mode {loose:o}, others may replace its files: chmod 700 {folder}")
    return content


def _missing(folder: Path, path: Path) -> str:
    if not folder.is_dir():
        return f"{folder}: there is no such folder of keys; `ftcc keys mesh {folder} --swarm NAME --uavs 1-4` makes one"
    if path.name == f"{AUTHORITY}.key":
        return f"{path}: is not here; certificates are made in the folder that holds the authority's key"
    holds = ", ".join(names_in(folder)[:_NAMED]) or "none"
    return f"{path}: is missing; certificates there: {holds}"


def load_key(folder: Path, name: str) -> Any:
    """The private key that belongs to a certificate.

    Raises
    ------
    MeshKeysError
        If it is missing, cannot be read or can be by others, or is of another kind.
    """
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    path = folder / f"{name}.key"
    text = _read(folder, path)
    try:
        key = load_pem_private_key(text, None)
    except (ValueError, TypeError):
        raise MeshKeysError(f"{path}: is no private key; `ftcc keys mesh` makes them") from None
    if not isinstance(key, EllipticCurvePrivateKey):
        raise MeshKeysError(f"{path}: is no key of ECDSA; `ftcc keys mesh` makes them")
    return key


def require_match(folder: Path, name: str, certificate: Certificate, key: EllipticCurvePrivateKey) -> None:
    """Refuse a key that belongs to another certificate.

    Raises
    ------
    MeshKeysError
    """
    if certificate.public_key() != key.public_key():
        raise MeshKeysError(
            f"{folder / name}.key: belongs to another certificate than {name}.crt; take both from one make"
        )
