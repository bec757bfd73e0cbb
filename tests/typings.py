"""``python -m tests.typings`` makes `.typings/`, by which editors and type checkers find the sources as ``ftcc.*``.

pip maps the folder ``link`` to the package ``ftcc.link`` (``package-dir`` in pyproject.toml) with an import hook, which
tools that do not run Python cannot follow. So each module gets a file that forwards its names to its source: a jump to
a definition ends in the source itself, and no links are needed. Run it again after adding a module or a name.
"""

from __future__ import annotations

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path

__all__ = ["make"]

ROOT = Path(__file__).resolve().parents[1]
WINGS = ("airside", "groundside", "link", "sim")


def defined(body: list[ast.stmt]) -> Iterator[str]:
    """The names that the statements of a module define; not those that it imports, except from its own rooms."""
    for node in body:
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.Assign() | ast.AnnAssign():
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                walked = (each for target in targets for each in ast.walk(target))
                yield from (
                    each.id for each in walked if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)
                )
            case ast.ImportFrom(names=names):
                yield from (alias.asname for alias in names if alias.asname == alias.name)
            case ast.If(body=inner, orelse=other):
                yield from defined([*inner, *other])


def forwarding(source: Path) -> str:
    """The text of the file that stands for a module."""
    module = ".".join(source.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    declared = source.with_suffix(".pyi")
    tree = ast.parse((declared if declared.is_file() else source).read_text(encoding="utf-8"))
    names = sorted({*defined(tree.body), *exported(tree)} - {"__all__"})
    return "".join(f"from {module} import {name} as {name}\n" for name in names)


def exported(tree: ast.Module) -> list[str]:
    """The names that stand in a module's ``__all__``."""
    for node in tree.body:
        match node:
            case ast.Assign(targets=[ast.Name(id="__all__")], value=ast.List(elts=entries)):
                return [entry.value for entry in entries if isinstance(entry, ast.Constant)]
    return []


def make(folder: Path = ROOT / ".typings") -> int:
    """Write the files anew; returns how many."""
    shutil.rmtree(folder, ignore_errors=True)
    sources = [path for wing in WINGS for path in (ROOT / wing).rglob("*.py")]
    for source in sources:
        target = folder / "ftcc" / source.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(forwarding(source), encoding="utf-8")
    return len(sources)


if __name__ == "__main__":
    print(f".typings: {make()} modules")
