"""Makes keys of an encrypted mesh: an authority, its certificates, and the part of them that one computer needs.

What the files are is in `mesh_keys`.
"""

from __future__ import annotations

import datetime
import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.link.mesh_keys import (
    AUTHORITY,
    DAYS,
    LEAD,
    NAME,
    MeshKeysError,
    Validity,
    load_certificate,
    load_key,
    names_in,
    now,
    require_match,
    require_valid,
    require_word,
    swarm_of,
)

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.x509 import Certificate

__all__ = ["add_certificates", "bundle", "new_authority"]

_AUTHORITY_DAYS = 3650.0
_BACKDATED = datetime.timedelta(hours=1)
"""By how much a certificate is valid before it is made: clocks of computers differ."""


def new_authority(folder: Path, swarm: str, days: float = _AUTHORITY_DAYS) -> None:
    """Make a folder with a new authority for a swarm; it has no certificates yet.

    Raises
    ------
    MeshKeysError
        If the folder holds keys or anything else already, cannot be written, or the name of the swarm will not do.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec

    require_word(swarm, "a swarm")
    _new_folder(folder)
    key = ec.generate_private_key(ec.SECP256R1())
    # Each authority has a name of its own: by it TLS tells a foreign one from a forgery.
    subject, begin = _subject(swarm, f"{AUTHORITY}-{secrets.token_hex(4)}"), now()
    certificate = (
        _builder(subject, subject, key, Validity(begin - _BACKDATED, begin + datetime.timedelta(days=days)))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(key_cert_sign=True, crl_sign=True), critical=True)
        .sign(key, _hash())
    )
    _write_pair(folder, AUTHORITY, certificate, key)


def add_certificates(
    folder: Path, names: Iterable[str], days: float = DAYS, *, renew: bool = False, begin_days: float = 0.0
) -> list[str]:
    """Make certificates by the authority of a folder, for those names that have none; the names for which it did.

    Parameters
    ----------
    folder : where the authority's key is; the certificates are written there.
    names : such as "uav-3", "node-a", "lead".
    days : how long they are valid from ``begin_days`` on, never longer than the authority.
    renew : make new keys and certificates also for those that have some.
    begin_days : when they become valid, days from now (an hour earlier, as clocks differ).

    Raises
    ------
    MeshKeysError
        If there is no authority, its key is missing or read by others, a name will not do, or a file cannot be written.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID

    authority, authority_key = load_certificate(folder, AUTHORITY), load_key(folder, AUTHORITY)
    require_match(folder, AUTHORITY, authority, authority_key)
    require_valid(folder, AUTHORITY, authority)
    swarm = swarm_of(authority)
    names = list(dict.fromkeys(names))
    for name in names:
        if not NAME.fullmatch(name):
            raise MeshKeysError(f"{name!r} is no name of a certificate; uav-3, node-a and {LEAD} are")
    present = set(names_in(folder))
    made = [name for name in names if renew or name not in present]
    begin = now() + datetime.timedelta(days=begin_days)
    validity = Validity(begin - _BACKDATED, min(begin + datetime.timedelta(days=days), authority.not_valid_after_utc))
    if validity.end <= validity.begin:
        raise MeshKeysError(f"{folder}: a certificate cannot end ({days:g} days) before it begins")
    for name in made:
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = (
            _builder(_subject(swarm, name), authority.subject, key, validity)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(digital_signature=True), critical=True)
            .add_extension(
                # Each end of a link is a server to those that connect to it, and a client to others.
                x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]),
                critical=False,
            )
            .add_extension(x509.SubjectAlternativeName([x509.DNSName(name)]), critical=False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()), critical=False
            )
            .sign(authority_key, _hash())
        )
        _write_pair(folder, name, certificate, key)
    return made


def bundle(folder: Path, out: Path, names: Iterable[str]) -> list[str]:
    """Copy to a new folder what one computer needs: certificates and keys of ``names``, never the authority's key.

    Raises
    ------
    MeshKeysError
        If one of them is missing, or ``out`` holds anything already or cannot be written.
    """
    names = list(dict.fromkeys(names))
    pairs = [(name, load_certificate(folder, name), load_key(folder, name)) for name in names]
    authority = load_certificate(folder, AUTHORITY)
    for name, certificate, key in pairs:
        require_match(folder, name, certificate, key)
    _new_folder(out)
    _write(out / f"{AUTHORITY}.crt", _pem(authority))
    for name, certificate, key in pairs:
        _write_pair(out, name, certificate, key)
    return names


def _hash() -> Any:
    from cryptography.hazmat.primitives import hashes

    return hashes.SHA256()


def _subject(swarm: str, name: str) -> Any:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    return x509.Name(
        [x509.NameAttribute(NameOID.ORGANIZATION_NAME, swarm), x509.NameAttribute(NameOID.COMMON_NAME, name)]
    )


def _builder(subject: Any, issuer: Any, key: EllipticCurvePrivateKey, validity: Validity) -> Any:
    from cryptography import x509

    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(validity.begin)
        .not_valid_after(validity.end)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _usage(**wanted: bool) -> Any:
    from cryptography import x509

    kinds = (
        "digital_signature content_commitment key_encipherment data_encipherment key_agreement key_cert_sign crl_sign "
        "encipher_only decipher_only"
    )
    return x509.KeyUsage(**{kind: wanted.get(kind, False) for kind in kinds.split()})


def _pem(certificate: Certificate) -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding

    return certificate.public_bytes(Encoding.PEM)


def _write_pair(folder: Path, name: str, certificate: Certificate, key: EllipticCurvePrivateKey) -> None:
    """The key first: a certificate without its key would count as one that is there."""
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    _write(folder / f"{name}.key", key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    _write(folder / f"{name}.crt", _pem(certificate))


def _write(path: Path, content: bytes) -> None:
    """Write a file that the user alone may read, whole or not at all."""
    unfinished = path.with_name(path.name + ".new")
    try:
        unfinished.unlink(missing_ok=True)
        with os.fdopen(os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(content)
        unfinished.replace(path)
    except OSError as error:
        raise MeshKeysError(f"{path}: cannot be written: {error.strerror or error}") from None


def _new_folder(folder: Path) -> None:
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if next(folder.iterdir(), None) is not None:
            raise MeshKeysError(f"{folder}: is not empty; keys are never overwritten, give a new folder")
        folder.chmod(0o700)
    except FileExistsError:
        raise MeshKeysError(f"{folder}: is a file; give a folder") from None
    except OSError as error:
        raise MeshKeysError(f"{folder}: cannot be written: {error.strerror or error}") from None
