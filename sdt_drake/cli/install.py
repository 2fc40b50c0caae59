"""The option `--install-completion`; a file of its own, as --help is faster without its imports."""

from cyclopts.completion.install import create_install_completion_command

from sdt_drake.cli.app import commands

run = create_install_completion_command(commands().install_completion, True)
