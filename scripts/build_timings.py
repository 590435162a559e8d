#!/usr/bin/env python3
"""scripts/build_timings.py FOLDER [COUNT]: the slowest steps in FOLDER/.ninja_log, and seconds by folder of sources.

Seconds are wall clock with everything else that ran beside. A file that was built several times counts once, with its
last time; a compiler cache makes most of them short (CCACHE_DISABLE=1 leaves it out).
"""
import collections
import pathlib
import re
import sys


def last_times(folder):
    """Output -> seconds of its last build, of those outputs that are still there."""
    times = {}
    for line in (folder / ".ninja_log").read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            start, end, _, output, _ = line.split("\t")
            times[output] = (int(end) - int(start)) / 1000
    return {output: seconds for output, seconds in times.items() if (folder / output).exists()}


def short(output):
    """CMakeFiles/raydix.dir/src/build/wide.cpp.o -> raydix: src/build/wide.cpp"""
    match = re.match(r"(?:(.*)/)?CMakeFiles/([^/]*)\.dir/(.*)\.o$", output)
    if not match:
        return output
    folder, target, source = match.groups()
    return f"{target}: {folder + '/' if folder else ''}{source}"


def main():
    folder = pathlib.Path(sys.argv[1])
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 15
    if not (folder / ".ninja_log").exists():
        sys.exit(f"{folder}: nothing was built here by ninja")
    times = last_times(folder)
    print(f"{len(times)} steps, {sum(times.values()):.0f} s together; the slowest:")
    for output, seconds in sorted(times.items(), key=lambda item: -item[1])[:count]:
        print(f"{seconds:8.1f} s  {short(output)}")
    groups = collections.Counter()
    for output, seconds in times.items():
        groups[str(pathlib.PurePosixPath(short(output)).parent)] += seconds
    print("by folder:")
    for name, seconds in groups.most_common(10):
        print(f"{seconds:8.1f} s  {name}")


if __name__ == "__main__":
    main()
