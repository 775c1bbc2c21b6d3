"""The cache of compiled kernels: never stale, never corrupt, and not required.

Most tests copy the decorator into a package of two small kernels, so that a process takes a second, and run it there.
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
def compiled_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the small package, its kernels compiled and cached."""
    root = tmp_path_factory.mktemp("filled")
    package = root / "minigolf_env" / "physics"
    package.mkdir(parents=True)
    for module in (jit, numba_internals):
        shutil.copy(str(module.__file__), package)
    for name, text in (("__init__", ""), ("../__init__", ""), ("callee", CALLEE), ("caller", CALLER)):
        (package / f"{name}.py").write_text(text)
    assert run_kernel(root) == (6.0, 0)
    return root


@pytest.fixture
def root(compiled_root: Path, tmp_path: Path) -> Path:
    """Return a copy of that folder for one test."""
    return Path(shutil.copytree(compiled_root, tmp_path / "toy"))


def start_process(root: Path, code: str = "", argument: str = "3.0", **environment: str) -> "subprocess.Popen[str]":
    """Start a process that runs code and then calls the kernel."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    # Python's bytecode cache would not notice an edit that keeps a file's size and time.
    variables = {**inherited, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    command = [sys.executable, "-c", code + CALL.format(argument)]
    return subprocess.Popen(command, cwd=root, env=variables, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def run_kernel(root: Path, code: str = "", warnings: int = 0, **environment: str) -> tuple[float, int]:
    """Return the kernel's result for 3 and the number of cache hits; check the number of warnings."""
    process = start_process(root, code, **environment)
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert err.count("Warning: ") == err.count("set NUMBA_CACHE_DIR") == warnings, err
    value, hits = out.split()
    return float(value), int(hits)


def cache_files(root: Path) -> list[Path]:
    """Return the cache files."""
    return sorted(root.rglob("*.nbc*"))


def test_second_process_loads_the_cached_kernel(root: Path) -> None:
    """A kernel is compiled once, and its file stays unchanged."""
    before = {file: file.read_bytes() for file in cache_files(root)}
    assert run_kernel(root) == (6.0, 1)
    assert {file: file.read_bytes() for file in cache_files(root)} == before
    assert len(before) == 2


def test_changed_callee_recompiles_its_callers(root: Path) -> None:
    """A changed constant in another file of the same size and time changes the result; stale files are removed."""
    before = cache_files(root)
    source = root / "minigolf_env" / "physics" / "callee.py"
    age = source.stat()
    source.write_text(CALLEE.replace("FACTOR = 2", "FACTOR = 5"))
    os.utime(source, ns=(age.st_atime_ns, age.st_mtime_ns))
    assert run_kernel(root) == (15.0, 0)
    assert run_kernel(root) == (15.0, 1)
    assert len(cache_files(root)) == len(before)
    assert not set(cache_files(root)) & set(before)


@pytest.mark.parametrize("changed", ["physics", "envs"])
def test_changed_layer_below_recompiles_kernels_of_other_folders(root: Path, changed: str) -> None:
    """A kernel of an observation changes with the physics and with the rules that it calls."""
    package = root / "minigolf_env"
    for name in ("physics", "envs", "envs/observations"):
        (package / name).mkdir(exist_ok=True)
        (package / name / "__init__.py").touch()
    rules = package / "envs" / "rules.py"
    rules.write_text(CALLER)
    rays = CALLER.replace("physics.callee import times", "envs.rules import double as times")
    (package / "envs" / "observations" / "rays.py").write_text(rays)
    observe = "import minigolf_env.physics.caller as caller; from minigolf_env.envs.observations.rays import double; "
    observe += "caller.double = double"
    assert [run_kernel(root, observe) for _ in range(2)] == [(6.0, 0), (6.0, 1)]
    if changed == "physics":
        (package / "physics" / "callee.py").write_text(CALLEE.replace("FACTOR = 2", "FACTOR = 5"))
    else:
        rules.write_text(CALLER.replace("times(x)", "times(2.5 * x)"))
    assert [run_kernel(root, observe) for _ in range(2)] == [(15.0, 0), (15.0, 1)]


@pytest.mark.parametrize("damage", ["empty", "half", "one bit"])
def test_damaged_cache_file_is_compiled_again(root: Path, damage: str) -> None:
    """A damaged file, as a crash or a failing disk leaves it, is replaced and not run."""
    damaged = {}
    for file in cache_files(root):
        content = bytearray(file.read_bytes())
        content[-1000] ^= 1
        damaged[file] = {"empty": b"", "half": content[: len(content) // 2], "one bit": content}[damage]
        file.write_bytes(damaged[file])
    assert run_kernel(root) == (6.0, 0)
    assert cache_files(root) == list(damaged)
    assert all(file.read_bytes() != content for file, content in damaged.items())


def test_two_processes_fill_the_cache_at_once(root: Path) -> None:
    """Each process finds the code of its own signature afterwards."""
    for file in cache_files(root):
        file.unlink()
    processes = [start_process(root, argument=argument) for argument in ("3", "3.0")]
    assert [process.communicate()[0].split()[0] for process in processes] == ["6", "6.0"]
    assert len(cache_files(root)) == 4
    for argument, answer in (("3", "6 1\n"), ("3.0", "6.0 1\n")):
        assert start_process(root, argument=argument).communicate() == (answer, "")


def test_kernels_work_without_a_writable_folder(root: Path) -> None:
    """If NUMBA_CACHE_DIR, the sources' folder and the user's cache are not writable, one warning says what to do."""
    pycache = root / "minigolf_env" / "physics" / "__pycache__"
    shutil.rmtree(pycache)
    pycache.write_text("a file, which no one can write into: not even root, whom permissions do not stop")
    nowhere = str(pycache / "below")
    assert run_kernel(root, warnings=1, NUMBA_CACHE_DIR=nowhere, HOME=nowhere, XDG_CACHE_HOME=nowhere) == (6.0, 0)


def test_kernels_work_on_a_full_disk(root: Path) -> None:
    """No partial file is left behind; one warning says what to do."""
    for file in cache_files(root):
        file.unlink()
    assert run_kernel(root, "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (999, 999))", warnings=1) == (
        6.0,
        0,
    )
    assert not cache_files(root)


def test_numba_cache_dir_overrides_the_default_folder(root: Path, tmp_path: Path) -> None:
    """The variable has precedence over the folder of the sources."""
    assert run_kernel(root, NUMBA_CACHE_DIR=str(tmp_path / "elsewhere")) == (6.0, 0)
    assert len(cache_files(tmp_path / "elsewhere")) == 2


def test_installed_package_caches_kernels_in_the_users_cache(root: Path, tmp_path: Path) -> None:
    """No files are written next to the sources, as pip would not remove what it did not install."""
    for file in cache_files(root):
        file.unlink()
    installed = Path(shutil.copytree(root, tmp_path / "site-packages"))
    home = str(tmp_path / "home")
    for hits in (0, 1):
        assert run_kernel(installed, HOME=home, XDG_CACHE_HOME=home) == (6.0, hits)
    assert not cache_files(installed) and len(cache_files(tmp_path / "home")) == 2


def test_numba_without_the_private_names_uses_its_own_cache(root: Path) -> None:
    """Kernels use numba's own cache if numba lacks the names that the package's cache is built on."""
    code = "import numba.core.caching; del numba.core.caching.CompileResultCacheImpl"
    assert run_kernel(root, code) == (6.0, 0)
    assert run_kernel(root, code) == (6.0, 1)


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_every_kernel_sets_forceinline() -> None:
    """Otherwise inlining depends on which caller is compiled first, and speed on the order of calls."""
    kinds = jit.device_function, jit.kernel, jit.inlined_kernel
    assert all(kind(lambda x: x).targetoptions["forceinline"] for kind in kinds)  # type: ignore[attr-defined]


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_other_functions_keep_numbas_cache() -> None:
    """The package's kernels use its cache; other numba functions are unaffected."""
    own = numba.njit(cache=True)(lambda: 0)
    assert isinstance(step.step._cache, numba_internals.KernelCache)
    assert not isinstance(own._cache, numba_internals.KernelCache)
    assert not numba.config.CACHE_LOCATOR_CLASSES


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_device_function_raises_when_called_from_python() -> None:
    """A device function called from Python, compiled or not, raises instead of crashing the process."""
    twice = jit.device_function(lambda x: 2.0 * x)
    four = jit.kernel(lambda x: twice(twice(x)))
    for _ in range(2):
        with pytest.raises(TypeError, match="decorate it with kernel"):
            twice(1.0)
        assert four(1.0) == 4.0
