#!/usr/bin/env python3
"""Times `cnerf run` as a whole and prints where the time goes: a row per part, medians over the runs.

    scripts/bench.sh run CAPTURE [--runs 5] [--cnerf build/release/cnerf] [--json FILE] [-- options of cnerf run]

Seconds between two lines of the program's JSON progress belong to the part that the later line names; what a line
without a part took belongs to the part before. User time, which other work on the machine changes less, is the whole
process's.
"""
import argparse
import json
import os
import platform
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

PARTS = {
    "reference colorizer": "colorizer: fit to references",
    "features": "sparse points", "matches": "sparse points",
    "stage 1": "stage 1",
    "stage 2: caching views": "stage 2: views cached",
    "stage 2": "stage 2: patches",
    "stage 2: colour for baking": "stage 2: colour for baking",
    "bake": "bake",
    "evaluate": "evaluation",
    "render turntable": "turntable",
}
START = "start and reading"


def run_once(command):
    """Seconds of each part, of the whole, to the volume, and of user time."""
    parts, volume, part = {}, None, START
    used_before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    begin = last = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            now = time.monotonic()
            event = json.loads(line)
            part = PARTS.get(event.get("task"), part)
            parts[part] = parts.get(part, 0) + now - last
            last = now
            if event.get("what") == "volume" and volume is None:
                volume = now - begin
    if process.returncode != 0:
        sys.exit(f"bench: {' '.join(command)}: exit code {process.returncode}")
    whole = time.monotonic() - begin
    parts[part] += begin + whole - last
    user = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - used_before
    return {"parts": parts, "volume": volume, "whole": whole, "user": user}


def spread(values):
    return {"median": statistics.median(values), "least": min(values), "most": max(values)}


def processor():
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    return names[0] if names else platform.machine()


def measured(arguments, options):
    runs = []
    for _ in range(arguments.runs):
        folder = tempfile.mkdtemp()
        out = os.path.join(folder, "run")
        try:
            runs.append(run_once([arguments.cnerf, "run", arguments.capture, "-o", out, "--progress", "json", *options]))
            with open(os.path.join(out, "metrics.json"), encoding="utf-8") as file:
                mean = json.load(file)["mean"]
        finally:
            shutil.rmtree(folder)
    parts = list(dict.fromkeys(part for run in runs for part in run["parts"]))
    figures = {part: spread([run["parts"].get(part, 0.0) for run in runs]) for part in parts}
    volumes = [run["volume"] for run in runs if run["volume"] is not None]
    if volumes:
        figures["to the volume on disk"] = spread(volumes)
    figures["whole run"] = spread([run["whole"] for run in runs])
    figures["user time of all cores"] = spread([run["user"] for run in runs])
    return {"machine": processor(), "cores": len(os.sched_getaffinity(0)), "capture": os.path.basename(arguments.capture),
            "options": options, "runs": arguments.runs, "seconds": figures, "metrics": mean}


def main():
    own = sys.argv[1:]
    options = own[own.index("--") + 1:] if "--" in own else []
    own = own[:own.index("--")] if "--" in own else own
    parser = argparse.ArgumentParser(prog="scripts/bench.sh run")
    parser.add_argument("capture")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--cnerf", default="build/release/cnerf")
    parser.add_argument("--json", help="also write all figures there")
    arguments = parser.parse_args(own)
    result = measured(arguments, options)
    print(f"{result['machine']}, {result['cores']} cores; `cnerf run {' '.join([result['capture'], *options])}`, "
          f"{result['runs']} runs.\n\n| part | seconds, median | least | most |\n|---|---|---|---|")
    for name, figure in result["seconds"].items():
        print(f"| {name} | {figure['median']:.1f} | {figure['least']:.1f} | {figure['most']:.1f} |")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=2)
            file.write("\n")


if __name__ == "__main__":
    main()
