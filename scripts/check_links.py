#!/usr/bin/env python3
"""Follows the relative links and anchors of every document in Markdown; names those that lead nowhere."""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
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


def main():
    found = [(d, t) for d in documents() for t in LINK.findall(prose(d.read_text()))]
    bad = [f"{d.relative_to(ROOT)}: {why}" for d, t in found if (why := complaint(d, t))]
    print("\n".join(bad + [f"docs: {len(found)} links, {len(bad)} lead nowhere"]))
    return 1 if bad or not found else 0


sys.exit(main())
