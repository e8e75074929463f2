#!/usr/bin/env python3
"""Times `cnerf run` as a whole and prints where the time goes: a row per part, medians over the runs.

    scripts/bench.sh run CAPTURE [--runs 5] [--cnerf build/release/cnerf] [--before CNERF] [--json FILE]
                         [-- options of cnerf run]

--before names an earlier program, which runs in turn with the other: what else the machine does then weighs on both.
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


def measured(program, capture, options):
    """Seconds as run_once has them, and the means of metrics.json."""
    folder = tempfile.mkdtemp()
    out = os.path.join(folder, "run")
    try:
        seconds = run_once([program, "run", capture, "-o", out, "--progress", "json", *options])
        with open(os.path.join(out, "metrics.json"), encoding="utf-8") as file:
            return seconds, json.load(file)["mean"]
    finally:
        shutil.rmtree(folder)


def summary(runs):
    """Spreads over the runs of a program: of each part, and of the whole."""
    parts = list(dict.fromkeys(part for run, _ in runs for part in run["parts"]))
    figures = {part: spread([run["parts"].get(part, 0.0) for run, _ in runs]) for part in parts}
    volumes = [run["volume"] for run, _ in runs if run["volume"] is not None]
    if volumes:
        figures["to the volume on disk"] = spread(volumes)
    figures["whole run"] = spread([run["whole"] for run, _ in runs])
    figures["user time of all cores"] = spread([run["user"] for run, _ in runs])
    metrics = {name: statistics.median([mean[name] for _, mean in runs])
               for name, value in runs[0][1].items() if isinstance(value, (int, float))}
    return {"seconds": figures, "metrics": metrics}


def print_table(found):
    """Medians with least and most; of two programs also the second's share of the first."""
    names = list(found)
    rows = list(dict.fromkeys(row for name in names for row in found[name]["seconds"]))
    heads = [f"{name}: median, least, most, s" for name in names] if len(names) > 1 else ["median, least, most, s"]
    print("| " + " | ".join(["part", *heads, *(["share"] if len(names) > 1 else [])]) + " |")
    print("|---" * (1 + len(heads) + (len(names) > 1)) + "|")
    for row in rows:
        cells = [row]
        figures = [found[name]["seconds"].get(row) for name in names]
        cells += [f"{f['median']:.2f}, {f['least']:.2f}, {f['most']:.2f}" if f else "" for f in figures]
        if len(names) > 1:
            both = all(figures) and figures[0]["median"] > 0
            cells.append(f"{figures[1]['median'] / figures[0]['median']:.2f}" if both else "")
        print("| " + " | ".join(cells) + " |")
    print()
    for metric in found[names[0]]["metrics"]:
        values = [found[name]["metrics"].get(metric) for name in names]
        print(f"{metric}: {', '.join('-' if value is None else f'{value:.4g}' for value in values)}")


def main():
    own = sys.argv[1:]
    options = own[own.index("--") + 1:] if "--" in own else []
    own = own[:own.index("--")] if "--" in own else own
    parser = argparse.ArgumentParser(prog="scripts/bench.sh run")
    parser.add_argument("capture")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--cnerf", default="build/release/cnerf")
    parser.add_argument("--before", help="an earlier cnerf to compare with")
    parser.add_argument("--json", help="also write all figures there")
    arguments = parser.parse_args(own)
    programs = {"before": arguments.before, "now": arguments.cnerf} if arguments.before else {"now": arguments.cnerf}
    runs = {name: [] for name in programs}
    for _ in range(arguments.runs):
        for name, program in programs.items():
            runs[name].append(measured(program, arguments.capture, options))
    found = {name: summary(of_one) for name, of_one in runs.items()}
    capture = os.path.basename(arguments.capture)
    cores = len(os.sched_getaffinity(0))
    print(f"{processor()}, {cores} cores; `cnerf run {' '.join([capture, *options])}`, {arguments.runs} runs.\n")
    print_table(found)
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump({"machine": processor(), "cores": cores, "capture": capture, "options": options,
                       "runs": arguments.runs, **found}, file, indent=2)
            file.write("\n")


if __name__ == "__main__":
    main()
