"""check_newer_clang.py COMPILE_COMMANDS CLANG: a newer compiler than those of the builds takes the program and the readers
and documents with JSON, where rules of overloading changed most from version to version. Syntax alone. Exit code 77: there
is no such compiler."""
import json
import pathlib
import re
import shlex
import subprocess
import sys

LOOKED_AT = re.compile(r"raydix_commands\.dir|raydix_documents\.dir|raydix\.dir/Unity/unity_(scene_json|io_files|machines)_cxx")


def command_of(entry, clang):
    """The entry's command for another compiler: without the cache, GCC's parameters, the precompiled header and the output."""
    words = shlex.split(entry["command"])
    words = words[next(k for k, word in enumerate(words) if word.startswith("-")):]
    kept = []
    for word in words:
        if word.startswith("--param") or word in ("-Winvalid-pch", "-Werror"):
            continue
        kept.append(word)
    for option in ("-o", "-include"):
        while option in kept:
            at = kept.index(option)
            del kept[at:at + 2]
    return [clang, *(word for word in kept if word != "-c"), "-fsyntax-only", "-w"]


def main(compile_commands, clang):
    if not pathlib.Path(clang).is_file():
        print("no clang 15 or newer was found")
        return 77
    entries = json.loads(pathlib.Path(compile_commands).read_text(encoding="utf-8"))
    chosen = [entry for entry in entries if LOOKED_AT.search(entry["command"])]
    failed = 0
    for entry in chosen:
        result = subprocess.run(command_of(entry, clang), cwd=entry["directory"], capture_output=True, text=True)
        if result.returncode:
            failed += 1
            print(f"{entry['file']}:\n{result.stderr[:4000]}")
    print(f"{clang}: {len(chosen)} sources, {failed} refused")
    return 1 if failed or not chosen else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
