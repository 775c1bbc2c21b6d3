"""Minigolf for reinforcement learning: importing this package registers ``MiniGolf-v0`` with Gymnasium.

The names in ``__all__`` are imported from their packages when they are first used, so that importing this package stays
cheap.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium as gym

if TYPE_CHECKING:
    from minigolf_env.courses import Course, list_courses, load_course
    from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
    from minigolf_env.physics import Status, Surface, TriangleMesh, World, sweep_sphere

__all__ = [
    "Course",
    "MiniGolfEnv",
    "MiniGolfVectorEnv",
    "Status",
    "Surface",
    "TriangleMesh",
    "World",
    "__version__",
    "list_courses",
    "load_course",
    "sweep_sphere",
]
__version__ = "0.1.0"

_LAZY_EXPORTS = {
    "minigolf_env.courses": ("Course", "list_courses", "load_course"),
    "minigolf_env.envs": ("MiniGolfEnv", "MiniGolfVectorEnv"),
    "minigolf_env.physics": ("Status", "Surface", "TriangleMesh", "World", "sweep_sphere"),
}
_LAZY_MODULES = {name: module for module, names in _LAZY_EXPORTS.items() for name in names}

gym.register(
    id="MiniGolf-v0",
    entry_point="minigolf_env.envs:MiniGolfEnv",
    vector_entry_point="minigolf_env.envs:MiniGolfVectorEnv",
)


def __getattr__(name: str) -> Any:
    """Import a name of ``__all__`` from its package when it is first used."""
    if name not in _LAZY_MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_LAZY_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the module's names, with those that are not imported yet."""
    return sorted({*globals(), *__all__})
