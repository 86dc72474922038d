"""The site of docs/ is built without a warning: every page in its place, every link and anchor leads somewhere."""

import os
import re
import subprocess
import sys
from types import SimpleNamespace

import building
import pytest
import yaml
from mkdocs.structure.files import File, Files
from paths import DOCS, ROOT

import affinet

QUIET = os.environ | {"NO_MKDOCS_2_WARNING": "1"}


def built(site, config=ROOT / "mkdocs.yml"):
    command = [sys.executable, "-m", "mkdocs", "build", "--config-file", str(config), "--site-dir", str(site)]
    return subprocess.run(command, cwd=ROOT, env=QUIET, capture_output=True, text=True, check=False)


def test_the_site_is_built_without_a_warning(tmp_path):
    done = built(tmp_path / "site")
    assert done.returncode == 0, done.stderr
    first = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert 'href="decisions/index.html"' in first
    assert 'href="files/agents/estimators/none.py"' in first
    assert (tmp_path / "site" / "files" / "agents" / "estimators" / "none.py").exists()
    assert [one for page in (tmp_path / "site").rglob("*.html") for one in from_elsewhere(page)] == []
    faults = (tmp_path / "site" / "notebooks" / "faults.html").read_text(encoding="utf-8")
    assert 'href="../testing.html"' in faults
    assert '.md"' not in faults
    python = (tmp_path / "site" / "reference" / "python.html").read_text(encoding="utf-8")
    assert [name for name in affinet.__all__ if name[0] != "_" and f'id="affinet.{name}"' not in python] == []


def from_elsewhere(page):
    """What a page loads over the network."""
    loaded = re.findall(r"<(?:script|link|img|iframe)\b[^>]*>", page.read_text(encoding="utf-8"))
    return [one for one in loaded if re.search(r"""(?:src|href)=["'](?:https?:)?//""", one)]


def test_what_is_loaded_over_the_network_is_found(tmp_path):
    page = tmp_path / "page.html"
    page.write_text(
        '<a href="https://zenoh.io">x</a><script src="https://unpkg.com/x"></script><link href="//a.b/c.css">'
    )
    assert from_elsewhere(page) == ['<script src="https://unpkg.com/x">', '<link href="//a.b/c.css">']


@pytest.mark.parametrize(
    ("link", "leads", "warned"),
    [
        ("../testing.md#faults", "../testing.html#faults", 0),
        ("../nowhere.md", "../nowhere.md", 1),
        ("https://zenoh.io", "https://zenoh.io", 0),
        ("#here", "#here", 0),
    ],
)
def test_links_of_a_notebook_lead_to_pages_or_are_warned_of(link, leads, warned, caplog):
    named = ("testing.md", "notebooks/faults.ipynb")
    page, notebook = (File(name, "docs", "site", use_directory_urls=False) for name in named)
    notebook.dest_uri = "notebooks/faults.html"
    said = building.on_page_content(f'<a href="{link}">', SimpleNamespace(file=notebook), Files([page, notebook]))
    assert said == f'<a href="{leads}">'
    assert len(caplog.records) == warned


@pytest.fixture
def planted(tmp_path):
    """A site with the strictness of ours, and pages of its own; the first alone is in its navigation."""

    def build(**pages):
        ours = yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), yaml.BaseLoader)
        for name, text in pages.items():
            page = tmp_path / "docs" / f"{name}.md"
            page.parent.mkdir(exist_ok=True)
            page.write_text(text)
        says = {"site_name": "planted", "strict": ours["strict"] == "true", "validation": ours["validation"]}
        (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(says | {"nav": [f"{next(iter(pages))}.md"]}))
        return built(tmp_path / "site", tmp_path / "mkdocs.yml")

    return build


@pytest.mark.parametrize(
    ("says", "found"),
    [
        ("[a](b.md)", "contains a link 'b.md', but the target is not found"),
        ("[a](index.md#not-there)", "but there is no such anchor on this page"),
        ("![a](pictures/none.png)", "contains a link 'pictures/none.png', but the target is not found"),
        ("[a](/b.md)", "contains an absolute link '/b.md'"),
        ("[a](folder/)", "contains an unrecognized relative link 'folder/'"),
    ],
)
def test_what_leads_nowhere_is_found(says, found, planted):
    assert planted(index="# First").returncode == 0
    done = planted(index=f"# First\n\n{says}\n")
    assert done.returncode == 1
    assert found in done.stderr


def test_a_page_that_the_navigation_forgets_is_found(planted):
    done = planted(index="# First", forgotten="# Second")
    assert done.returncode == 1
    assert "forgotten.md" in done.stderr


def test_a_name_that_the_library_does_not_tell_is_found():
    library = (DOCS / "library.md").read_text(encoding="utf-8")
    assert "::: affinet.recovers" in list(building.names(library))
    with pytest.raises(ValueError, match="no line for recovers"):
        list(building.names(library.replace("`recovers`", "")))
