"""Make the virtual environment and install everything in it, each file checked against its hash.

    python3 tools/set_up.py            into .venv
    python3 tools/set_up.py elsewhere

A run that failed or was interrupted is taken up by running it again.  The syntax is that of Python 3.6, so that an
old one can say that it is too old.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OLDEST = (3, 11)
AGAIN = "then run the same command again: it goes on where it stopped"
# What pip or venv printed, and what to do about it; the first that fits is told.
ADVICE = [
    (
        r"ensurepip|No module named '?pip\b",
        "This Python comes without its venv module. On Debian and Ubuntu: apt install python3-venv\n"
        f"(or python{sys.version_info[0]}.{sys.version_info[1]}-venv), {AGAIN}.",
    ),
    (
        r"DO NOT MATCH THE HASHES",
        "A downloaded file is not the one that was tested: a broken download, a damaged cache, or a changed file.\n"
        f"Empty the cache with `{{python}} -m pip cache purge`, {AGAIN}.\n"
        "If the hash differs once more, do not switch the check off: report it, with the lines above.",
    ),
    (
        r"No space left|not enough space|Disk quota",
        f"The disk is full. The course needs about 1 GB: make room, {AGAIN}.",
    ),
    (
        r"NewConnectionError|NameResolution|name resolution|getaddrinfo|ConnectTimeout|Read ?timed? ?out|SSLError"
        r"|ProxyError|ConnectionResetError|Network is unreachable|Connection (refused|aborted|broken)|IncompleteRead"
        r"|from versions: none",
        f"The package index gave nothing. Check the network (and HTTPS_PROXY behind a proxy), {AGAIN}.",
    ),
    (
        r"Could not find a version|No matching distribution|Failed building wheel|Could not build wheels"
        r"|requires a different Python|not a supported wheel",
        f"There is no built file of the version that is locked for Python {sys.version_info[0]}.{sys.version_info[1]}"
        " on this machine.\n"
        "Python 3.11 to 3.14, 64 bits, on Linux, macOS and Windows are tested. Remove {venv} and choose one of them:\n"
        "make PYTHON=python3.12 setup",
    ),
    (
        r"Permission denied|PermissionError",
        f"{{venv}} cannot be written by you. Remove it, or see who owns it, {AGAIN}.",
    ),
]
OTHERWISE = "Remove {venv} and run the same command again. If it fails once more, report the lines above."


def advice(printed):
    """What to do about a failed step, from what it printed."""
    return next((what for pattern, what in ADVICE if re.search(pattern, printed, re.I)), OTHERWISE)


def run(command, venv):
    """Run a step and show what it prints; where it fails, end with what to do."""
    step = subprocess.Popen(
        [str(word) for word in command],
        cwd=str(ROOT),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        universal_newlines=True,
        errors="replace",
    )
    printed = []
    for line in step.stdout:
        printed.append(line)
        sys.stdout.write(line)
        sys.stdout.flush()
    if step.wait():
        what = advice("".join(printed)).format(venv=venv, python=python_of(venv))
        sys.exit(f"\nThe set-up stopped at: {' '.join(str(word) for word in command)}\n{what}")


def python_of(venv):
    return venv / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def works(venv):
    """Whether the environment is there, of a Python that still exists and is new enough, and has its pip."""
    try:
        probe = f"import pip, sys; sys.exit(sys.version_info < {OLDEST})"
        return subprocess.run([str(python_of(venv)), "-c", probe], stderr=subprocess.DEVNULL).returncode == 0
    except OSError:
        return False


def main():
    if sys.version_info < OLDEST:
        sys.exit(
            "Python 3.11 or newer is needed, and this is {}.{}. If there is a newer one beside it, name it:\n"
            "make PYTHON=python3.12 setup".format(*sys.version_info[:2])
        )
    venv = Path(sys.argv[1] if len(sys.argv) > 1 else ".venv").absolute()
    print(f"Setting up {venv.name}: a minute or two, once.", flush=True)
    if not works(venv):
        run([sys.executable, "-m", "venv", "--clear", venv], venv)
    pip = [python_of(venv), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    run([*pip, "--require-hashes", "-r", "requirements.lock"], venv)
    run([*pip, "--no-deps", "--no-build-isolation", "--editable", "."], venv)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("\nInterrupted. Run the same command again: it goes on where it stopped.")
