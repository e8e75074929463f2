#!/usr/bin/env python3
"""What training makes of captures as they are: luminance of held-out views, some seeds a row, on a GPU.

    scripts/real_captures.py pack OUT [--captures FOLDER]      packs the captures; wants no GPU
    scripts/real_captures.py train OUT [--part I/N] [--check CNERF-CUDA-CHECK] [--seeds N] [--only ROW...]
    scripts/real_captures.py table OUT

FOLDER has flower, fox, fruit, lego and robovision. If not given, it is scenes in $CNERF_DATA, else in ../shared/data.
`train` needs the packed captures and cnerf-cuda-check alone, so that it runs where nothing else is installed; parts run
side by side, each on a GPU of its own. What is there already stays. `table` prints medians over seeds of the mean and
of the worst view.
"""
import argparse
import os
import re
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BASE = "log2_rows=17 cone=128 distortion=1e-4 table_decay=0.1 marks=0 views=1 aligned=1"  # as configs/gpu.toml
LEARN = {"nothing": "", "default": "depth=0.01 exposures=1", "poses": "depth=0.01 exposures=1 poses=1",
         "all": "depth=0.01 exposures=1 poses=1 lenses=1"}

# Captures as they are packed: the folder, or the command that makes it; options of pack_capture.
CAPTURES = {
    "flower": ("flower", "downscale=8 points=1"),
    "fox": ("fox", "downscale=2 points=1"),
    "fruit": ("fruit", "points=1"),
    "lego": ("lego", ""),
    "robovision": ("robovision", "points=1"),
    "fox-few": ("fox", "downscale=2 few=5 points=1"),
    "flower-few": ("flower", "downscale=8 few=6 points=1"),
    "cloth": ("sample --cloth", "points=1"),
    "shadow": ("sample --cloth --moving-shadow --exposures", "points=1"),
    "flower-prepared": ("prepare flower/images_4", "downscale=2 points=1"),
}
# Cameras that a training learns are adjusted to features first, which a packed capture holds.
ADJUSTED = {"poses": " poses=1", "all": " poses=1 lenses=1"}


def rows():
    """Name of a row: capture, what makes its cameras worse, seconds, what is learned, options."""
    table = {}

    def row(capture, seconds, learn, more="", worse="", name=None):
        table[f"{name or capture} {seconds} s {learn}"] = (capture, worse, seconds, learn, more)

    for seconds in (10, 5, 2, 1):
        for learn in LEARN:
            row("flower", seconds, learn)
    for learn in LEARN:
        row("fox", 10, learn)
        row("fruit", 10, learn)
        row("fruit", 30, learn)
    for learn in ("nothing", "default", "poses"):
        row("lego", 10, learn)
        row("robovision", 5, learn)
    for learn in ("default", "poses"):
        row("cloth", 5, learn)
        row("shadow", 5, learn)
        row("fox-few", 5, learn)
        row("flower-few", 5, learn)
        for seconds in (10, 30):
            row("flower-prepared", seconds, learn)
    row("fox", 10, "default", "gain=0.3", name="fox, light of views ±30 %")
    row("fox", 10, "nothing", "gain=0.3", name="fox, light of views ±30 %")
    for capture in ("fox", "lego"):
        for learn in ("default", "poses"):
            row(capture, 10, learn, worse="degrees=0.5 shift=0.005", name=f"{capture}, poses disturbed")
    for learn in ("default", "all"):
        row("fox", 10, learn, worse="focal=0.03", name="fox, focal length 3 % too long")
    return table


def packed_as(capture, worse, learn):
    """Name and options of a packed capture."""
    options = CAPTURES[capture][1] + (f" {worse}" if worse else "") + ADJUSTED.get(learn, "")
    return re.sub(r"[^a-z0-9.]+", "-", f"{capture} {worse} {ADJUSTED.get(learn, '')}").strip("-"), options


def source_of(options, name):
    """The folder of a capture, made where a command makes it."""
    source = CAPTURES[name][0]
    folder = options.out / name
    if source.startswith("sample"):
        command = [*source.split(), "-o", folder]
    elif source.startswith("prepare"):
        command = ["prepare", Path(options.captures) / source.split()[1], "-o", folder]
    else:
        return Path(options.captures) / source
    if not (folder / "transforms.json").exists():  # written last
        subprocess.run([ROOT / "build/release/cnerf", *command, "--overwrite"], check=True)
    return folder


def pack(options):
    for capture, worse, _, learn, _ in rows().values():
        name, more = packed_as(capture, worse, learn)
        target = options.out / "packed" / name
        if target.exists():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        unfinished = target.with_name(name + "~")
        subprocess.run([ROOT / "build/release/tests/cuda/pack_capture", source_of(options, capture), unfinished,
                        *more.split()], check=True)
        unfinished.rename(target)


def file_of(out, name):
    return out / "rows" / (re.sub(r"[^a-z0-9]+", "-", name) + ".txt")


def train(options):
    part, parts = map(int, options.part.split("/"))
    known = rows()
    if unknown := set(options.only or []) - set(known):
        sys.exit(f"real_captures: no such row: {', '.join(sorted(unknown))}; there are: {', '.join(known)}")
    chosen = {name: row for name, row in known.items() if not options.only or name in options.only}
    # The long ones first, dealt out in turns.
    order = sorted(chosen.items(), key=lambda item: -item[1][2])
    (options.out / "rows").mkdir(parents=True, exist_ok=True)
    for name, (capture, worse, seconds, learn, more) in order[part - 1::parts]:
        file = file_of(options.out, name)
        if file.exists():
            continue
        packed = options.out / "packed" / packed_as(capture, worse, learn)[0]
        command = [options.check, "train", f"capture={packed}", f"seconds={seconds}", f"seeds={options.seeds}", *BASE.split(),
                   *LEARN[learn].split(), *more.split()]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
        if done.returncode != 0:
            print(f"real_captures: {name}: exit code {done.returncode}", file=sys.stderr)
            continue
        file.with_suffix(".part").write_text(done.stdout)
        file.with_suffix(".part").rename(file)
        print(name, flush=True)


NUMBER = r"(-?[0-9.]+|-?nan|-?inf)"
MEANS = re.compile(rf"mean / worst: as given {NUMBER} / {NUMBER} dB, exposure fitted {NUMBER} / {NUMBER} dB, "
                   rf"aligned {NUMBER} / {NUMBER} dB, near opacity {NUMBER}")


def table(options):
    print("| capture, training | as given | exposure fitted | aligned | near opacity | steps/s | cameras |\n"
          "|---|---|---|---|---|---|---|")
    for name in sorted(rows(), key=lambda name: re.split("[ ,]", name)[0]):
        file = file_of(options.out, name)
        if not file.exists():
            continue
        text = file.read_text()
        seeds = [tuple(map(float, found)) for found in MEANS.findall(text)]
        columns = [statistics.median(column) for column in zip(*seeds)]
        cells = [f"{columns[i]:.2f}, {columns[i + 1]:.2f}" for i in (0, 2, 4)]
        spread = max(seed[2] for seed in seeds) - min(seed[2] for seed in seeds)
        speed = statistics.median(float(found) for found in re.findall(r"\| ([0-9]+) steps/s", text))
        angles = [float(found) for found in re.findall(r"([0-9.]+) learned", text)]
        cameras = f"{statistics.median(angles):.3f} degrees" if any(angles) else ""
        print(f"| {name} | {cells[0]} | {cells[1]} (±{spread / 2:.2f}) | {cells[2]} | {columns[6]:.3f} | {speed:.0f} "
              f"| {cameras} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["pack", "train", "table"])
    parser.add_argument("out", type=Path)
    data = os.environ.get("CNERF_DATA", ROOT.parent / "shared/data")
    parser.add_argument("--captures", default=os.path.join(data, "scenes"))
    parser.add_argument("--check", default=str(ROOT / "build/release/tests/cuda/cnerf-cuda-check"))
    parser.add_argument("--part", default="1/1")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--only", nargs="*")
    options = parser.parse_args()
    {"pack": pack, "train": train, "table": table}[options.what](options)


main()
