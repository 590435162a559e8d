#!/usr/bin/env python3
"""tests/c/symbols_test.py LIBRARY HEADER...: what libraydix_c.so shows is what its headers declare, each with its version.

Prints what differs and exits 1. Exits 77, skipped, without `nm`.
"""
import pathlib
import re
import shutil
import subprocess
import sys

VERSION = "RAYDIX_C_0"


def declared(header):
    """Names of the calls in a header."""
    text = re.sub(r"/\*.*?\*/", "", header.read_text(encoding="utf-8"), flags=re.DOTALL)
    return set(re.findall(r"RAYDIX_C_API [\w\s*]*?\b(raydix_\w+)\(", text))


def shown(library):
    """Symbols that a library lets others use, its version nodes left out."""
    told = subprocess.run(["nm", "-D", "--defined-only", "--with-symbol-versions", library], check=True,
                          capture_output=True, text=True)
    symbols = [line.split() for line in told.stdout.splitlines()]
    return {symbol[-1] for symbol in symbols if symbol[-2] != "A"}


def main(library, *headers):
    if shutil.which("nm") is None:
        print("skipped: there is no nm")
        return 77
    names = set().union(*(declared(pathlib.Path(header)) for header in headers))
    expected = {f"{name}@@{VERSION}" for name in names}
    seen = shown(library)
    for symbol in sorted(seen - expected):
        print(f"shown, but not declared: {symbol}")
    for symbol in sorted(expected - seen):
        print(f"declared, but not shown: {symbol}")
    print(f"{len(names)} calls declared, {len(seen)} symbols shown")
    return 1 if seen != expected or len(names) < 40 else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
