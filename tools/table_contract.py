"""An import contract: a noun's tables are asked by its own modules alone.

A table stands beside the operations on it, which other nouns do import; so this contract looks at
names, not at modules.
"""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from importlinter import Contract, ContractCheck, fields, output


class TableContract(Contract):  # type: ignore[misc]
    """No module outside a table's package imports its class, but for annotations alone."""

    type_name = "tables"
    nouns = fields.StringField()
    """The package whose tables are kept."""

    def check(self, graph: Any, verbose: bool) -> ContractCheck:  # noqa: ARG002 - import-linter's signature; its graph has modules
        """Every use of a table outside its package, by any module of the same root package."""
        nouns = str(self.nouns)
        trees = {
            _module(path): ast.parse(path.read_bytes())
            for path in sorted(Path(nouns.partition(".")[0]).rglob("*.py"))
        }
        tables = {
            m: found
            for m, tree in trees.items()
            if m.startswith(f"{nouns}.") and (found := _tables(tree))
        }
        links = [
            f"{module} -> {used} (l.{line})"
            for module, tree in trees.items()
            for owner, line, used in _uses(tree, tables)
            if not f"{module}.".startswith(f"{owner.rpartition('.')[0]}.")
        ]
        return ContractCheck(kept=not links, metadata={"links": links})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """A line for each use."""
        for link in check.metadata["links"]:
            output.print_error(f"- {link}")


def _module(path: Path) -> str:
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def _tables(tree: ast.Module) -> set[str]:
    """Names of the mapped classes of a module."""
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    return {
        c.name
        for c in classes
        for n in c.body
        if isinstance(n, ast.Assign) and "__tablename__" in ast.unparse(n)
    }


def _uses(tree: ast.Module, tables: dict[str, set[str]]) -> Iterator[tuple[str, int, str]]:
    """The module, line and full name of each table that a module imports, or reaches through a
    module that it imports.
    """
    modules: dict[str, str] = {}
    for node in _run(tree):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if alias.name in tables.get(node.module or "", ()):
                    yield node.module or "", node.lineno, f"{node.module}.{alias.name}"
                modules[alias.asname or alias.name] = f"{node.module}.{alias.name}"
        elif isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            owner = modules.get(owner, owner)
            if node.attr in tables.get(owner, ()):
                yield owner, node.lineno, f"{owner}.{node.attr}"


def _run(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes that run: those for the type checker alone are left out."""
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield child
            yield from _run(child)
