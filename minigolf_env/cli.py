"""The ``minigolf`` command line: parse the arguments, run a command, and turn errors into exit codes."""

from __future__ import annotations

import argparse
import inspect
import os
import sys
from collections.abc import Sequence

from minigolf_env import __version__
from minigolf_env.apps.command_line import name_option, parse
from minigolf_env.apps.commands import COMMANDS_BY_NAME, OPTIONS_BY_ARGUMENT

EXIT_FAILED = 1
"""Exit code of a command that failed; argparse and tyro exit with 2 after an invalid command line."""

EXIT_NO_DISPLAY = 2
"""Exit code of a command that cannot draw."""

EXIT_INTERRUPTED = 130
"""Exit code after Ctrl-C, as in shells."""

NO_MEMORY_MESSAGE = "not enough memory; give smaller numbers."
"""Message of a MemoryError of Python, which has none of its own."""

CLI_DESCRIPTION = "Play minigolf, record videos, evaluate policies, and check courses."

CLI_EPILOG = """examples:       minigolf COMMAND --help
completion:     minigolf --tyro-write-completion {bash,zsh,tcsh} FILE
exit codes:     0 success; 1 failure; 2 an invalid command line, or no display"""


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line, or the given arguments; a user's mistake prints one line on stderr."""
    words = list(sys.argv[1:] if args is None else args)
    try:
        _run(words)
        sys.stdout.flush()
    except BrokenPipeError:  # The reader of the output has closed it: `minigolf courses | head -3`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ValueError, OSError, ImportError, MemoryError) as error:
        sys.exit(_print_error(error, EXIT_FAILED, words))
    except RuntimeError as error:
        from minigolf_env.rendering import RenderingError

        if not isinstance(error, RenderingError):
            raise
        sys.exit(_print_error(error, EXIT_NO_DISPLAY, words))
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)


def _run(words: Sequence[str]) -> None:
    """Choose the command with argparse, and run it with the arguments that tyro parses.

    ``tyro.extras.subcommand_cli_from_dict`` alone would not do: it has no ``--version``, its list of commands contains
    the full help of each, and ``minigolf --help`` would start more slowly, because it imports tyro and inspects all
    commands.
    """
    # Write a completion script.
    if words[:1] == ["--tyro-write-completion"]:
        import tyro

        tyro.extras.subcommand_cli_from_dict(COMMANDS_BY_NAME, prog="minigolf", args=words)
    # Find the command.
    formatter = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        "minigolf", description=CLI_DESCRIPTION, epilog=CLI_EPILOG, formatter_class=formatter
    )
    parser.add_argument("--version", action="version", version=f"minigolf_env {__version__}")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", dest="command", required=True)
    for name, command in COMMANDS_BY_NAME.items():
        subparsers.add_parser(name, help=str(command.__doc__).splitlines()[0], add_help=False)
    name = parser.parse_args(words[:1]).command
    # Run it.
    parse(COMMANDS_BY_NAME[name], words[1:], prog=f"minigolf {name}")


def _print_error(error: Exception, exit_code: int, words: Sequence[str]) -> int:
    """Print an error of the command in a command line, and return the exit code."""
    options = inspect.signature(COMMANDS_BY_NAME[words[0]]).parameters
    message = name_option(str(error) or NO_MEMORY_MESSAGE, options, OPTIONS_BY_ARGUMENT)
    print(f"minigolf: {message}", file=sys.stderr)
    return exit_code


if __name__ == "__main__":
    main()
