"""Completion for bash and zsh out of the table of options, of the form that common/base/cli_complete.c gives the programs in C."""
import re

from .options import TABLE

BASH = """# {called} in bash: made by `{called} --completion=bash`
_ilf_files() # WORD ENDING: files that end so, and folders; readline's own way where there are none
{{
    local IFS=$'\\n'
    COMPREPLY+=($(compgen -f -X "!*.$2" -- "$1") $(compgen -d -- "$1"))
    compopt -o filenames -o default 2>/dev/null
}}
_ilf_complete_{name}()
{{
    local cur=${{COMP_WORDS[COMP_CWORD]}} option=${{COMP_WORDS[COMP_CWORD - 1]}} k
    COMPREPLY=()
    # --name=value comes as three words
    if [[ $cur == = && $option == --* ]]; then option+== cur=
    elif [[ $option == = ]]; then option=${{COMP_WORDS[COMP_CWORD - 2]}}=; fi
    case $option in
{values}    esac
    for ((k = 1; k < COMP_CWORD; k++)); do [[ ${{COMP_WORDS[k]}} != -- ]] || cur=; done # operands from there on
    if [[ $cur == -* ]]; then
        COMPREPLY=($(compgen -W "{options}" -- "$cur"))
        return
    fi
    compopt -o default 2>/dev/null
}}
complete -F _ilf_complete_{name} {called}
"""
ZSH = """#compdef {called}
# {called} in zsh: made by `{called} --completion=zsh`

_arguments -s -S{options} \\
        '*:file:_files'
"""


def words(option):
    """Small words that may follow: "auto|X" has one."""
    return [w for w in option.value.split("|") if re.fullmatch("[a-z-]+", w)]


def ending(option):
    """None: no file; "": any; else what its name ends with."""
    if option.value == "FILE":
        return ""
    found = re.fullmatch(r"[A-Z]+\.(\w+)", option.value)
    return found[1] if found else None


def bash_value(o):
    keys = f"--{o.name}|--{o.name}=" + (f"|-{o.letter}" if o.letter else "")
    does = f' COMPREPLY+=($(compgen -W "{" ".join(words(o))}" -- "$cur"));' if words(o) else ""
    if ending(o):
        does += f' _ilf_files "$cur" "{ending(o)}";'
    elif ending(o) == "":
        does += " compopt -o default 2>/dev/null;"
    return f"    {keys}){does} return ;;\n"


def zsh_option(o):
    sign = "=" if o.value else ""
    name = f"'(-{o.letter} --{o.name})'{{-{o.letter}{'+' if o.value else ''},--{o.name}{sign}}}" if o.letter else f"'--{o.name}{sign}'"
    about = re.match("[^:;(]*", o.text)[0].strip()
    about = (about if len(about) <= 60 else about[:60].rsplit(" ", 1)[0]).replace("'", "'\\''")
    value = ""
    if o.value:
        does = f"({' '.join(words(o))})" if words(o) else f'_files -g "*.{ending(o)}"' if ending(o) else "_files" if ending(o) == "" else " "
        value = ":" + re.sub("['\"]", "", o.value) + ":" + does
    return f" \\\n        {name}'[{about}]{value}'"


def script(shell, name, called):
    """The text that bash or zsh reads; called: the name that the program is started by."""
    if shell == "bash":
        return BASH.format(name=name, called=called, values="".join(bash_value(o) for o in TABLE if o.value),
                           options="".join(f"-{o.letter} " * bool(o.letter) + f"--{o.name} " for o in TABLE))
    return ZSH.format(called=called, options="".join(map(zsh_option, TABLE)))
