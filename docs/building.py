"""What the site has beside the pages of docs/: README.md as its first, the names of `affinet`, and files that are linked to."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from marked import Lines, titled
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import affinet

_OF_THE_ROOT = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md"}
_DECISIONS = "decisions/index.md"
FILES = "files"  # where copies lie of what is linked to and is not in docs/
_LINK = re.compile(r"(?<=\]\()(?!\w+:)[^)\s#]+")
_HREF = re.compile(r'href="((?!\w+:)[^"#][^"]*)"')
_LOG = logging.getLogger("mkdocs.hooks.building")  # a warning of which ends a strict build
_GROUP = re.compile(r"^\| (.*) \| \|\n\|---\|---\|\n((?:\| .*\n)+)", re.MULTILINE)
_REFERENCE = re.compile(r"\[(.*?)\]\(.*?\)")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """List the decisions, which need no line each in `mkdocs.yml`."""
    pages = [_DECISIONS, *(f"decisions/{page.name}" for page in _decisions(Path(config.docs_dir)))]
    next(section["Inside"] for section in config.nav or () if "Inside" in section).append({"Decisions": pages})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Take in what is made of other files, and copies of what pages link to that is not in docs/."""
    docs, root = Path(config.docs_dir), Path(config.docs_dir).parent
    made = {page: _moved((root / name).read_text(encoding="utf-8"), root, docs) for name, page in _OF_THE_ROOT.items()}
    made["reference/python.md"] = "\n".join(names((docs / "library.md").read_text(encoding="utf-8"))) + "\n"
    made[_DECISIONS] = "\n".join(_listed(_decisions(docs))) + "\n"
    for page, text in made.items():
        files.append(File.generated(config, page, content=text))
    for linked in sorted({one for page in files.documentation_pages() for one in _outside(page, docs)}):
        copied = File.generated(config, f"{FILES}/{linked.relative_to(root)}", abs_src_path=str(linked))
        files.append(copied)
    return files


def on_page_content(html: str, page: Page, files: Files, **_: Any) -> str:
    """Have links of notebooks lead to pages, as those of pages do; mkdocs rewrites and checks the latter alone."""
    if not page.file.src_uri.endswith(".ipynb"):
        return html
    folder = Path(page.file.src_uri).parent

    def led(link: re.Match[str]) -> str:
        name, mark, anchor = link[1].partition("#")
        target = files.get_file_from_path(os.path.normpath(folder / name))
        if target is None:
            _LOG.warning("%s contains a link '%s', but the target is not found", page.file.src_uri, name)
            return link[0]
        return f'href="{target.url_relative_to(page.file)}{mark}{anchor}"'

    return _HREF.sub(led, html)


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, **_: Any) -> str:
    """Have links out of docs/ lead to the copies, and those to folders to their lists."""
    docs, folder = Path(config.docs_dir), Path(config.docs_dir, page.file.src_uri).parent

    def led(link: re.Match[str]) -> str:
        target = Path(os.path.normpath(folder / link[0]))
        if target == docs / "decisions":
            target = docs / _DECISIONS
        elif not target.is_relative_to(docs):
            name = str(target.relative_to(docs.parent))
            target = docs / _OF_THE_ROOT.get(name, f"{FILES}/{name}")
        return os.path.relpath(target, folder)

    return _LINK.sub(led, markdown)


def _moved(text: str, root: Path, docs: Path) -> str:
    """A page of the root as it is said from within docs/."""
    return _LINK.sub(lambda link: os.path.relpath(root / link[0], docs), text)


def _outside(page: File, docs: Path) -> Iterator[Path]:
    """Files that a page links to and that are not in docs/, nor pages of the site."""
    if page.src_uri.endswith(".md"):
        for link in _LINK.findall(page.content_string):
            target = Path(os.path.normpath(docs / Path(page.src_uri).parent / link))
            if target.is_file() and not target.is_relative_to(docs) and target.name not in _OF_THE_ROOT:
                yield target


def _decisions(docs: Path) -> Sequence[Path]:
    return sorted(docs.glob("decisions/*.md"))


def _listed(decisions: Iterable[Path]) -> Lines:
    yield from titled("Decisions", "What was decided, why, and what was measured for it.", "")
    for page in decisions:
        title = page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        yield f"- [{title}]({page.name})"


def names(library: str) -> Lines:
    """The page of all public names, in the groups that the page of the library has.

    Raises
    ------
    ValueError
        When that page does not have all of them.
    """
    yield from titled("Python", "Everything that `affinet` has ([how it is used](../library.md)).")
    missing = {name for name in affinet.__all__ if not name.startswith("_")}
    for title, rows in _GROUP.findall(library.partition("\n## Names\n")[2]):
        yield from ("", "## " + _REFERENCE.sub(r"\1", title).capitalize())
        for name in re.findall(r"`(\w+)", " ".join(row.split("|")[1] for row in rows.splitlines())):
            if name in missing:
                missing.remove(name)
                yield from ("", f"::: affinet.{name}")
    if missing:
        raise ValueError(f"docs/library.md has no line for {', '.join(sorted(missing))}")
