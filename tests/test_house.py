"""The house as it is drawn: which room may import which, what may stand in a file, what the lock holds."""

import ast
import importlib.metadata
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]

# the arrows of docs: a room and the rooms below it that it may import
ROOMS: dict[str, set[str]] = {
    "assets": set(),
    "flightlog": set(),
    "sim": {"assets", "flightlog"},
    "estimators": {"flightlog"},
    "controllers": {"flightlog"},
    "scenarios": {"assets", "flightlog", "sim", "estimators", "controllers"},
    "identification": {"assets", "flightlog", "sim", "estimators"},
    "helideck": {"assets", "flightlog", "sim", "estimators", "controllers", "scenarios", "identification"},
}
OUTSIDE = {"tests", "benchmarks", "docs", "tools"}  # no room imports these
BLIND = {"flightlog", "sim", "scenarios", "assets"}  # what tests/blind may import

BY_NAME = {"import_module", "__import__", "files", "find_spec"}  # calls that reach a package by its name

PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def imported(source: str) -> Iterator[tuple[int, str]]:
    """Line and top-level package of every import in a module, those inside functions and by name included."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.partition(".")[0]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.lineno, node.module.partition(".")[0]
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in BY_NAME and isinstance(node.args[0].value, str):
                yield node.lineno, node.args[0].value.partition(".")[0]


def modules(*places: str) -> list[Path]:
    return sorted(path for place in places for path in (ROOT / place).rglob("*.py"))


def tracked_texts() -> Iterator[tuple[Path, str]]:
    """Every text file that is, or would be, under version control."""
    listing = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT, capture_output=True, check=True,
    ).stdout
    for name in filter(None, listing.decode().split("\0")):
        path = ROOT / name
        if not path.is_file():
            continue
        content = path.read_bytes()
        if b"\0" not in content[:8192]:
            yield path.relative_to(ROOT), content.decode("utf-8")


def upward(source: str, allowed: set[str]) -> list[tuple[int, str]]:
    return [(line, name) for line, name in imported(source) if name in (ROOMS.keys() | OUTSIDE) - allowed]


@pytest.mark.parametrize("room", [room for room in ROOMS if (ROOT / room).is_dir()])
def test_arrows_run_downward_only(room):
    allowed = ROOMS[room] | {room}
    faults = [f"{path.relative_to(ROOT)}:{line} imports {name}" for path in modules(room)
              for line, name in upward(path.read_text(), allowed)]
    assert not faults, "\n".join(faults)


def test_the_blind_injector_never_sees_identification():
    faults = [f"{path}:{line} imports {name}" for path in modules("tests/blind")
              for line, name in upward(path.read_text(), BLIND | {"tests"})]
    faults += [f"{path}:{line}" for path in modules("identification") for line, name in imported(path.read_text())
               if name == "tests"]
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(
    "source",
    ["import sim", "import sim.world as w", "from sim.world import World", "def f():\n    from sim import World",
     "import importlib\nimportlib.import_module('sim.world')", "from importlib.resources import files\nfiles('sim')"],
)
def test_an_arrow_upward_is_seen_however_it_is_written(source):
    assert upward(source, ROOMS["estimators"] | {"estimators"})
    assert not upward(source, ROOMS["scenarios"] | {"scenarios"})


# written with a class in brackets, so that this file does not hold them itself
FORBIDDEN = {
    "an absolute path of some machine": re.compile(
        r"(?<![\w./~$}>)-])/(?:[w]ork|[f]arm|[t]mp|[h]ome|[r]oot|[U]sers|[o]pt)/[\w.]"
    ),
    "a registry's address": re.compile(
        r"pypi[.]org|pythonhosted[.]org|npmjs[.](?:org|com)|deb[.]debian[.]org|archive[.]ubuntu|"
        r"index[-_]url|find[-_]links|/simpl[e]/",
        re.IGNORECASE,
    ),
}


@pytest.mark.parametrize("what", FORBIDDEN)
def test_no_file_holds(what):
    faults = [f"{path}:{number}: {line.strip()[:120]}" for path, text in tracked_texts()
              for number, line in enumerate(text.splitlines(), 1) if FORBIDDEN[what].search(line)]
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(
    ("what", "parts"),
    [
        ("an absolute path of some machine", ["cd /", "work/project"]),
        ("an absolute path of some machine", ['open("/', 'tmp/x.csv")']),
        ("an absolute path of some machine", ["PATH=/", "home/somebody/bin"]),
        ("a registry's address", ["pip install --index", "-url=https://mirror"]),
        ("a registry's address", ["https://files.python", "hosted.org/x.whl"]),
    ],
)
def test_a_planted_address_is_found(what, parts):
    assert FORBIDDEN[what].search("".join(parts))
    assert not FORBIDDEN[what].search("see https://example.com/home/docs, assets/tmp/x, ~/place/y and PYTHON=/its/path")


def locked() -> dict[str, Requirement]:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    pins = [Requirement(line) for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(pin.name): pin for pin in pins}


def declared() -> list[Requirement]:
    project = PYPROJECT["project"]
    needs = [*project["dependencies"], *project["optional-dependencies"]["dev"], *PYPROJECT["build-system"]["requires"]]
    return [Requirement(need) for need in needs]


def test_the_lock_names_one_exact_version_each_and_no_address():
    for line in (ROOT / "requirements.lock").read_text().splitlines():
        assert re.fullmatch(r'#.*|[a-z0-9-]+==[\w.]+( ; python_version [<>=]+ "[\d.]+")?', line), line


@pytest.mark.parametrize("need", declared(), ids=str)
def test_every_declared_dependency_is_locked_in_a_version_that_fits(need):
    pin = locked()[canonicalize_name(need.name)]
    (exact,) = pin.specifier
    assert need.specifier.contains(exact.version, prereleases=True), f"{pin} does not satisfy {need}"


def test_the_lock_holds_all_that_its_packages_need():
    """The lock is installed without asking what else is needed, so it must be complete."""
    missing = []
    for name, pin in locked().items():
        if pin.marker and not pin.marker.evaluate():
            continue
        for need in map(Requirement, importlib.metadata.requires(name) or []):
            if need.marker and not need.marker.evaluate({"extra": ""}):
                continue
            found = locked().get(canonicalize_name(need.name))
            if found is None or not need.specifier.contains(next(iter(found.specifier)).version, prereleases=True):
                missing.append(f"{pin} needs {need}")
    assert not missing, "\n".join(missing)


def test_every_library_that_a_room_imports_is_declared():
    provides = importlib.metadata.packages_distributions()
    runtime = {canonicalize_name(Requirement(need).name) for need in PYPROJECT["project"]["dependencies"]}
    # pydantic is built around pydantic_core and pins it; dm_env is the interface that dm-control implements
    runtime |= {"pydantic-core", "dm-env"}
    ours = ROOMS.keys() | sys.stdlib_module_names
    faults = [f"{path.relative_to(ROOT)}:{line} imports {name}" for path in modules(*ROOMS)
              for line, name in imported(path.read_text())
              if name not in ours and not runtime & {canonicalize_name(d) for d in provides.get(name, [])}]
    assert not faults, "\n".join(faults)


def test_every_room_is_packaged():
    packaged = set(PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"])
    there = {room for room in ROOMS if any((ROOT / room).rglob("*.*"))}
    assert there <= packaged <= ROOMS.keys()


def test_importing_sim_loads_no_opengl():
    code = "import sys, pkgutil, importlib, sim\n" \
        "print(*[n for n in sys.modules if n.partition('.')[0] == 'OpenGL' or n.startswith('mujoco.egl')])"
    environment = {key: value for key, value in os.environ.items() if key != "MUJOCO_GL"}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True,
                          check=True)
    assert done.stdout.split() == []


def _public_functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Functions and methods that others may call; numba's kernels take their types from their arguments."""
    bodies = [tree.body] + [node.body for node in tree.body if isinstance(node, ast.ClassDef)]
    for node in (node for body in bodies for node in body if isinstance(node, ast.FunctionDef)):
        if not node.name.startswith("_") and not any("njit" in ast.unparse(d) for d in node.decorator_list):
            yield node


def test_public_functions_say_their_types():
    faults = []
    for path in modules(*ROOMS):
        for function in _public_functions(ast.parse(path.read_text())):
            arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
            bare = [a.arg for a in arguments if a.annotation is None and a.arg not in ("self", "cls")]
            if bare or function.returns is None:
                what = ", ".join(bare) or "return"
                faults.append(f"{path.relative_to(ROOT)}:{function.lineno} {function.name}: {what}")
    assert not faults, "\n".join(faults)
