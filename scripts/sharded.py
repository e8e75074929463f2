#!/usr/bin/env python3
"""Runs the suites of a build on a machine with many cores, the long ones in shards.

    scripts/sharded.py BUILD [--slots N] [--only REGEX] [--without REGEX] [--costs FILE] [--results FILE] [--root FOLDER]

`ctest --parallel 64` waits for its longest suite, which under a sanitizer takes most of an hour. Here a suite of
GoogleTest is run by several processes, each with some of its cases (GTEST_TOTAL_SHARDS). How long a suite takes is read
from CTest's own record of an earlier run in --costs (CTestCostData.txt; BUILD's by default). Every process has two
processors to itself. A line per process goes to --results; what stands there as passed is not run again, so that the
same command goes on. With --root the suites run in a chroot, where BUILD has the same path. Exits with 1 where one
fails or a sanitizer reports.
"""
import argparse
import json
import math
import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

SECONDS_PER_SHARD = 45
MOST_SHARDS = 40
TIME_LIMIT = 3600
REPORTS = ("ThreadSanitizer", "AddressSanitizer", "runtime error:")


def known_costs(file):
    """Seconds by suite."""
    costs = {}
    if file.exists():
        for line in file.read_text().splitlines():
            words = line.split()
            if len(words) == 3:
                costs[words[0]] = float(words[2])
    return costs


def cases_of(command, environment, root):
    """How many a suite has: shards beyond them would be empty."""
    listed = subprocess.run(root + command + ["--gtest_list_tests"], env=environment, capture_output=True, text=True)
    return sum(line.startswith("  ") for line in listed.stdout.splitlines())


def jobs_of(arguments, root):
    listing = subprocess.run(root + ["ctest", "--test-dir", arguments.build, "--show-only=json-v1"],
                             capture_output=True, text=True, check=True)
    costs = known_costs(Path(arguments.costs or Path(arguments.build) / "Testing/Temporary/CTestCostData.txt"))
    jobs = []
    for test in json.loads(listing.stdout)["tests"]:
        name, command = test["name"], test.get("command")
        if not re.search(arguments.only, name) or (arguments.without and re.search(arguments.without, name)):
            continue
        properties = {entry["name"]: entry["value"] for entry in test.get("properties", [])}
        environment = dict(os.environ)
        environment.update(pair.split("=", 1) for pair in properties.get("ENVIRONMENT", []))
        job = {"name": name, "command": command, "environment": environment, "cost": costs.get(name, 1.0),
               "folder": properties.get("WORKING_DIRECTORY", arguments.build),
               "skip": properties.get("SKIP_RETURN_CODE"), "passes": properties.get("PASS_REGULAR_EXPRESSION"),
               "makes": set(properties.get("FIXTURES_SETUP", [])), "after": set(properties.get("DEPENDS", [])),
               "needs": set(properties.get("FIXTURES_REQUIRED", []))}
        shards = min(MOST_SHARDS, math.ceil(job["cost"] / SECONDS_PER_SHARD))
        if command and shards > 1 and any(word.startswith("--gtest_filter") for word in command):
            shards = max(1, min(shards, cases_of(command, environment, root)))
        else:
            shards = 1
        for shard in range(shards):
            part = dict(job, cost=job["cost"] / shards)
            if shards > 1:
                part["name"] = f"{name}#{shard + 1}/{shards}"
                part["environment"] = dict(environment, GTEST_TOTAL_SHARDS=str(shards), GTEST_SHARD_INDEX=str(shard))
            jobs.append(part)
    return jobs


class Runner:
    def __init__(self, jobs, done, results, root):
        self.pending = sorted((job for job in jobs if job["name"] not in done),
                              key=lambda job: (not job["makes"], -job["cost"]))
        self.unfinished = {job["name"] for job in self.pending}
        self.makers = {}
        for job in self.pending:
            for fixture in job["makes"]:
                self.makers.setdefault(fixture, set()).add(job["name"])
        self.results, self.root = results, root
        self.lock = threading.Lock()
        self.failed = []

    def is_ready(self, job):
        waits_for = {name for fixture in job["needs"] for name in self.makers.get(fixture, ())}
        return not (waits_for | job["after"]) & self.unfinished

    def state_after(self, job, slot):
        if not job["command"]:
            return "not built"
        cores = os.cpu_count()
        bound = ["taskset", "-c", f"{2 * slot % cores},{(2 * slot + 1) % cores}"]
        inside = ["sh", "-c", 'cd "$0" && exec "$@"', job["folder"], *job["command"]]
        try:
            ran = subprocess.run(bound + self.root + ["setarch", "-R"] + inside, env=job["environment"], text=True,
                                 errors="replace", stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                 stderr=subprocess.STDOUT, timeout=TIME_LIMIT)
        except subprocess.TimeoutExpired:
            return "out of time"
        is_good = any(re.search(text, ran.stdout) for text in job["passes"]) if job["passes"] else ran.returncode == 0
        reported = any(text in ran.stdout for text in REPORTS)
        if not reported and (is_good or ran.returncode == job["skip"]):
            return "passed" if is_good else "skipped"
        sys.stdout.write(f"==== {job['name']}\n{ran.stdout[-20000:]}\n")
        return "report" if reported else f"failed {ran.returncode}"

    def work(self, slot):
        while True:
            with self.lock:
                if not self.pending:
                    return
                job = next(filter(self.is_ready, self.pending), None)
                if job:
                    self.pending.remove(job)
            if not job:
                time.sleep(0.2)
                continue
            begin = time.monotonic()
            state = self.state_after(job, slot)
            with self.lock:
                self.unfinished.discard(job["name"])
                if state not in ("passed", "skipped"):
                    self.failed.append(job["name"])
                self.results.write(f"{job['name']}\t{state}\t{time.monotonic() - begin:.1f}\n")
                self.results.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=os.path.abspath)
    parser.add_argument("--slots", type=int, default=max(1, os.cpu_count() // 2))
    parser.add_argument("--only", default="")
    parser.add_argument("--without", default="")
    parser.add_argument("--costs")
    parser.add_argument("--results")
    parser.add_argument("--root")
    arguments = parser.parse_args()
    root = ["chroot", arguments.root] if arguments.root else []
    file = Path(arguments.results or Path(arguments.build) / "sharded.tsv")
    lines = [line.split("\t") for line in file.read_text().splitlines()] if file.exists() else []
    done = {line[0] for line in lines if line[1] in ("passed", "skipped")}
    with file.open("a") as results:
        runner = Runner(jobs_of(arguments, root), done, results, root)
        count = len(runner.pending)
        threads = [threading.Thread(target=runner.work, args=(slot,)) for slot in range(arguments.slots)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    print(f"{count - len(runner.failed)} of {count} passed or were skipped", *runner.failed, sep="\n")
    return 1 if runner.failed else 0


if __name__ == "__main__":
    sys.exit(main())
