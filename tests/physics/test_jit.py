"""Compiled kernels on disk: never stale, never mixed up, and not needed.

Most tests copy the decorator into a package of two tiny kernels, so that a process takes a second, and run it there.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from minigolf_env.physics import jit, numba_internals, step

CALLEE = """
from minigolf_env.physics.jit import kernel
FACTOR = 2
@kernel
def times(x):
    return FACTOR * x
"""

CALLER = """
from minigolf_env.physics.callee import times
from minigolf_env.physics.jit import kernel
@kernel
def double(x):
    return times(x)
"""

CALL = """
from minigolf_env.physics.caller import double
print(double({}), sum(double.stats.cache_hits.values()))
"""


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the tiny package, its kernels compiled and kept."""
    root = tmp_path_factory.mktemp("filled")
    package = root / "minigolf_env" / "physics"
    package.mkdir(parents=True)
    for module in (jit, numba_internals):
        shutil.copy(str(module.__file__), package)
    for name, text in (("__init__", ""), ("../__init__", ""), ("callee", CALLEE), ("caller", CALLER)):
        (package / f"{name}.py").write_text(text)
    assert run(root) == (6.0, 0)
    return root


@pytest.fixture
def toy(filled: Path, tmp_path: Path) -> Path:
    """Return a copy of that folder for one test."""
    return Path(shutil.copytree(filled, tmp_path / "toy"))


def start(root: Path, code: str = "", argument: str = "3.0", **environment: str) -> "subprocess.Popen[str]":
    """Start a process that runs code and then calls the kernel."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    # Python's own bytecode cache would not notice an edit that leaves a file's size and time alone.
    variables = {**inherited, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    command = [sys.executable, "-c", code + CALL.format(argument)]
    return subprocess.Popen(command, cwd=root, env=variables, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def run(root: Path, code: str = "", warnings: int = 0, **environment: str) -> tuple[float, int]:
    """Return what the kernel makes of 3, and how often it came from the disk; check how many warnings there are."""
    process = start(root, code, **environment)
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert err.count("Warning: ") == err.count("set NUMBA_CACHE_DIR") == warnings, err
    value, hits = out.split()
    return float(value), int(hits)


def kept(root: Path) -> list[Path]:
    """Return the files of compiled code."""
    return sorted(root.rglob("*.nbc*"))


def test_a_second_process_loads_what_the_first_compiled(toy: Path) -> None:
    """A kernel is compiled once, and its file is left alone."""
    before = {file: file.read_bytes() for file in kept(toy)}
    assert run(toy) == (6.0, 1)
    assert {file: file.read_bytes() for file in kept(toy)} == before
    assert len(before) == 2


def test_a_changed_callee_reaches_its_callers(toy: Path) -> None:
    """Another constant in another file, of the same length and age, changes the result; no old code is left behind."""
    before = kept(toy)
    source = toy / "minigolf_env" / "physics" / "callee.py"
    age = source.stat()
    source.write_text(CALLEE.replace("FACTOR = 2", "FACTOR = 5"))
    os.utime(source, ns=(age.st_atime_ns, age.st_mtime_ns))
    assert run(toy) == (15.0, 0)
    assert run(toy) == (15.0, 1)
    assert len(kept(toy)) == len(before)
    assert not set(kept(toy)) & set(before)


@pytest.mark.parametrize("damage", ["empty", "half", "one bit"])
def test_a_damaged_file_is_compiled_again(toy: Path, damage: str) -> None:
    """Whatever a crash or a failing disk left in a file is not run, and replaced."""
    damaged = {}
    for file in kept(toy):
        content = bytearray(file.read_bytes())
        content[-1000] ^= 1
        damaged[file] = {"empty": b"", "half": content[: len(content) // 2], "one bit": content}[damage]
        file.write_bytes(damaged[file])
    assert run(toy) == (6.0, 0)
    assert kept(toy) == list(damaged)
    assert all(file.read_bytes() != content for file, content in damaged.items())


def test_two_processes_fill_the_cache_at_once(toy: Path) -> None:
    """Each finds its own code afterwards, whichever signature it compiled."""
    for file in kept(toy):
        file.unlink()
    processes = [start(toy, argument=argument) for argument in ("3", "3.0")]
    assert [process.communicate()[0].split()[0] for process in processes] == ["6", "6.0"]
    assert len(kept(toy)) == 4
    for argument, answer in (("3", "6 1\n"), ("3.0", "6.0 1\n")):
        assert start(toy, argument=argument).communicate() == (answer, "")


def test_without_a_folder_to_write_to_kernels_work(toy: Path) -> None:
    """Neither NUMBA_CACHE_DIR nor the sources' folder nor the user's can be written to: one warning says what to do."""
    pycache = toy / "minigolf_env" / "physics" / "__pycache__"
    shutil.rmtree(pycache)
    pycache.write_text("a file, which no one can write into: not even root, whom permissions do not stop")
    nowhere = str(pycache / "below")
    assert run(toy, warnings=1, NUMBA_CACHE_DIR=nowhere, HOME=nowhere, XDG_CACHE_HOME=nowhere) == (6.0, 0)


def test_on_a_full_disk_kernels_work(toy: Path) -> None:
    """A file that cannot be written whole is not left behind; one warning says what to do."""
    for file in kept(toy):
        file.unlink()
    assert run(toy, "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (999, 999))", warnings=1) == (6.0, 0)
    assert not kept(toy)


def test_numba_cache_dir_is_where_kernels_are_kept(toy: Path, tmp_path: Path) -> None:
    """The variable goes before the folder of the sources."""
    assert run(toy, NUMBA_CACHE_DIR=str(tmp_path / "elsewhere")) == (6.0, 0)
    assert len(kept(tmp_path / "elsewhere")) == 2


def test_an_installed_package_keeps_kernels_in_the_users_cache(toy: Path, tmp_path: Path) -> None:
    """What pip did not bring it would not remove: an empty package would stay behind."""
    for file in kept(toy):
        file.unlink()
    installed, home = Path(shutil.copytree(toy, tmp_path / "site-packages")), str(tmp_path / "home")
    for hits in (0, 1):
        assert run(installed, HOME=home, XDG_CACHE_HOME=home) == (6.0, hits)
    assert not kept(installed) and len(kept(tmp_path / "home")) == 2


def test_another_numba_falls_back_to_its_own_cache(toy: Path) -> None:
    """Where a numba lacks the names that the cache is made of, kernels are kept as numba keeps them."""
    code = "import numba.core.caching; del numba.core.caching.CompileResultCacheImpl"
    assert run(toy, code) == (6.0, 0)
    assert run(toy, code) == (6.0, 1)


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_every_kernel_says_itself_that_it_is_inlined() -> None:
    """Else it takes after the first caller to be compiled, and the speed of a step after what was asked first."""
    kinds = jit.device_function, jit.kernel, jit.inlined_kernel
    assert all(kind(lambda x: x).targetoptions["forceinline"] for kind in kinds)  # type: ignore[attr-defined]


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_the_cache_is_the_kernels_alone() -> None:
    """This numba has the names, and other functions keep its own cache."""
    own = numba.njit(cache=True)(lambda: 0)
    assert isinstance(step.step._cache, numba_internals.KernelCache)
    assert not isinstance(own._cache, numba_internals.KernelCache)
    assert not numba.config.CACHE_LOCATOR_CLASSES


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_kernels_for_kernels_refuse_python() -> None:
    """Called from Python, compiled or not, a kernel without a wrapper says so instead of crashing the process."""
    twice = jit.device_function(lambda x: 2.0 * x)
    four = jit.kernel(lambda x: twice(twice(x)))
    for _ in range(2):
        with pytest.raises(TypeError, match="decorate it with kernel"):
            twice(1.0)
        assert four(1.0) == 4.0
