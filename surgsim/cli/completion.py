"""`surgsim completion`: the Tab key in bash, zsh and fish."""

import argparse
import sys

HELP = "complete commands and names with the Tab key, in bash, zsh or fish"
EXAMPLES = """Prints a script for the shell. It asks surgsim itself what can come next: commands, options,
and the names of scenarios, suites, controllers and studies; elsewhere the shell completes paths.

examples:
  eval "$(surgsim completion bash)"           this shell; in ~/.bashrc every one
  eval "$(surgsim completion zsh)"            the same, after compinit in ~/.zshrc
  surgsim completion fish | source            the same, in config.fish
"""
SCRIPTS = {
    "bash": """\
_surgsim_complete() {
    local word="${COMP_WORDS[COMP_CWORD]}" IFS=$'\\n'
    COMPREPLY=($(surgsim completion --words "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null | cut -f1))
    if [ "${#COMPREPLY[@]}" -eq 0 ]; then
        COMPREPLY=($(compgen -f -- "$word"))
        compopt -o filenames 2>/dev/null
    fi
}
complete -F _surgsim_complete surgsim
""",
    "zsh": """\
_surgsim_complete() {
    local -a found shown
    local line
    for line in "${(@f)$(surgsim completion --words "${(@)words[2,CURRENT]}" 2>/dev/null)}"; do
        [[ -n "$line" ]] && found+=("${line%%$'\\t'*}") && shown+=("${line/$'\\t'/  -- }")
    done
    if (( ${#found} )); then
        compadd -l -d shown -a found
    else
        _files
    fi
}
compdef _surgsim_complete surgsim
""",
    "fish": """\
function __surgsim_complete
    set -l words (commandline -opc) (commandline -ct)
    set -l found (surgsim completion --words $words[2..-1] 2>/dev/null)
    if test (count $found) -gt 0
        printf '%s\\n' $found
    else
        __fish_complete_path (commandline -ct)
    end
end
complete -c surgsim -f -a '(__surgsim_complete)'
""",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("shell", nargs="?", metavar="SHELL", help=f"one of {', '.join(SCRIPTS)}")
    parser.add_argument("--words", nargs=argparse.REMAINDER, metavar="WORD", help=argparse.SUPPRESS)


def execute(options: argparse.Namespace) -> int:
    """Print a shell's script, or what can come next after some words."""
    from surgsim.errors import SurgsimError, unknown_name

    if options.words is not None:
        _print_next(options.words)
        return 0
    if options.shell is None:
        raise SurgsimError(f"SHELL is missing: {', '.join(SCRIPTS)}")
    if options.shell not in SCRIPTS:
        raise SurgsimError(unknown_name(options.shell, "shell", SCRIPTS))
    print(SCRIPTS[options.shell], end="")
    return 0


def _print_next(words: list[str]) -> None:
    """Print each word that can stand in place of the last of `words`, and a tab and what it is."""
    from surgsim.cli.candidates import candidates
    from surgsim.cli.main import build_parser

    lines = [f"{word}\t{about}".rstrip() for word, about in candidates(build_parser(), words)]
    sys.stdout.write("".join(f"{line}\n" for line in lines))
