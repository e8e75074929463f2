#!/usr/bin/env python3
"""Follows the relative links, anchors and paths of the repository in every document in Markdown; names those that lead
nowhere. Documents of docs/history may speak of paths that were."""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
PATH = re.compile(r"`((?:src|encoding|bake|export|viewer|configs|scripts|tests|docs)/[\w./*-]+)`")
IGNORED_FOLDERS = {"build", "node_modules", ".git", "out"}


def documents():
    return sorted(p for p in ROOT.rglob("*.md") if not IGNORED_FOLDERS & set(p.relative_to(ROOT).parts))


def prose(text):
    """The text without code, which may hold brackets of its own."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"```.*?```", "", text, flags=re.S))


def anchors(path):
    """What GitHub makes of the headings: lower case, no punctuation, hyphens for spaces."""
    text = re.sub(r"```.*?```", "", path.read_text(), flags=re.S)
    headings = re.findall(r"^#+ +(.*)$", text, flags=re.M)
    return {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in headings}


def complaint(document, target):
    """Why a link leads nowhere; empty where it leads somewhere."""
    if re.match(r"[a-z]+:", target):
        return ""  # another place's business
    name, _, anchor = target.partition("#")
    path = (document.parent / name).resolve() if name else document
    if not path.exists():
        return f"{target}: no such file"
    if anchor and path.suffix == ".md" and anchor not in anchors(path):
        return f"{target}: no such heading"
    return ""


def missing_paths(document):
    """Paths of the repository in code spans that nothing lies at; a capital word stands for what a reader chooses."""
    if "history" in document.parts:
        return []
    named = PATH.findall(document.read_text())
    return [path for path in named if not any(ROOT.glob(re.sub(r"[A-Z]{2,}", "*", path.rstrip("/"))))]


def main():
    found = [(d, t) for d in documents() for t in LINK.findall(prose(d.read_text()))]
    bad = [f"{d.relative_to(ROOT)}: {why}" for d, t in found if (why := complaint(d, t))]
    bad += [f"{d.relative_to(ROOT)}: {path}: nothing lies there" for d in documents() for path in missing_paths(d)]
    print("\n".join(bad + [f"docs: {len(found)} links, {len(bad)} links or paths lead nowhere"]))
    return 1 if bad or not found else 0


sys.exit(main())
