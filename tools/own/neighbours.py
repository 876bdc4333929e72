"""A model's Python file imported, and which files beside it are: modules that it imports from its folder."""

import ast
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType


def neighbours(source: Path) -> list[Path]:
    """Python files in a model's folder, or in packages there, that it imports, and what these import; not itself."""
    folder, found, asked = source.parent, dict[Path, None](), [source]
    while asked:
        for name in _imported(asked.pop()):
            file, package = folder / f"{name}.py", folder / name
            of_package = sorted(package.rglob("*.py")) if (package / "__init__.py").is_file() else []
            for one in [file] if file.is_file() else of_package:
                if one not in found and one != source:
                    found[one] = None
                    asked.append(one)
    return list(found)


def import_file(name: str, file: Path, *folders: Path) -> tuple[ModuleType, dict[str, ModuleType]]:
    """A Python file as the module `name`, and its neighbours' modules by name, all as they are on the disk now.

    folders: in which what it imports is looked for first.
    """
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    beside = module_names(file)
    for one in beside:
        sys.modules.pop(one, None)
    sys.path[:0] = [str(one) for one in folders]
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.path[: len(folders)]
    return module, {one: sys.modules[one] for one in beside if one in sys.modules}


def module_names(source: Path) -> list[str]:
    """Names that the neighbours of a model's file are imported by."""
    parts = [one.relative_to(source.parent).with_suffix("").parts for one in neighbours(source)]
    return [".".join(one[:-1] if one[-1] == "__init__" else one) for one in parts]


def _imported(file: Path) -> Iterator[str]:
    """First names of modules that a Python file imports, the standard library's not; of another kind of file none."""
    if file.suffix != ".py":
        return
    for one in ast.walk(ast.parse(file.read_bytes(), str(file))):
        names = []
        if isinstance(one, ast.Import):
            names = [each.name for each in one.names]
        elif isinstance(one, ast.ImportFrom):
            names = [one.module] if one.module else [each.name for each in one.names]
        yield from (name.split(".")[0] for name in names if name.split(".")[0] not in sys.stdlib_module_names)
