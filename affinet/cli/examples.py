"""Examples of every command: their help ends with them, and tests run them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class Example(NamedTuple):
    """A command line, and what it is for.

    Parameters
    ----------
    line
        As it is typed.
    says
        What comes of it.
    short
        What tests type behind it, so that it is over soon.
    alone
        Whether it runs by itself: not where it wants another machine, a display, or a run that flies meanwhile.
    status
        Its exit status.
    """

    line: str
    says: str
    short: str = ""
    alone: bool = True
    status: int = 0


# What one does next, for who types no command; those that there are not are left out.
NEXT: Sequence[Example] = (
    Example("affinet check corridor", "can this scenario fly? nothing starts"),
    Example(
        "affinet run corridor --runtime inprocess",
        "fly it in this process; without the option, a process for each agent",
    ),
    Example("affinet watch runs/corridor-TIME", "look at what was flown"),
    Example("affinet list scenarios", "what there is; also estimators, laws, profiles, verbs, checkers, ..."),
    Example("affinet new project my-swarm", "a project of your own, which passes its tests at once"),
    Example("affinet study bursts --quick", "many seeds over a grid of settings, a figure, and verdicts on claims"),
    Example("affinet doctor", "is all there that affinet needs?"),
)

_BRIEF = "--duration 0.5 --set record.enabled=false"

EXAMPLES: Mapping[str, Sequence[Example]] = {
    "run": (
        Example("affinet run corridor", "over processes; leaves runs/corridor-TIME/", _BRIEF),
        Example("affinet run corridor --runtime inprocess --json", "the same bits in this process", _BRIEF),
        Example("affinet run bursts --estimator rkf --set network.profile=wifi_busy", "with overrides", _BRIEF),
        Example("affinet run corridor --seeds 1-50", "fifty runs side by side: a mean and its interval", _BRIEF),
        Example(
            "affinet run corridor --seeds 1-20 --sweep network.availability=0.2,0.5,1 --sweep agents.estimator=none,rkf",
            "each combination of settings",
            _BRIEF,
        ),
        Example(
            "affinet run bursts --sweep agents.estimator=ga-rkf,rkf --check 'bounded(5)'", "who keeps together?", _BRIEF
        ),
    ),
    "check": (
        Example("affinet check corridor", "a table of what was checked"),
        Example(
            "affinet check hexa --set formation.leaders=[4,5,7] --json", "exit status 2 where it cannot fly", status=2
        ),
    ),
    "replay": (
        Example("affinet replay runs/kept --runtime inprocess", "fly it again, and compare every bit"),
        Example("affinet replay runs/kept --verdicts --seed 8 --runtime inprocess", "other noise, the same losses"),
    ),
    "watch": (
        Example("affinet watch runs/kept", "in a window", alone=False),
        Example("affinet watch runs/ga-rkf runs/rkf", "two on one timeline", alone=False),
        Example("affinet watch runs/kept --serve", "in a browser", alone=False),
    ),
    "render": (
        Example("affinet render runs/kept --at 9.8 --out swarm.png", "a moment, for a paper or a page", "--at 0.3"),
        Example("affinet render runs/kept --speed 4 --out swarm.gif", "a film", "--fps 1"),
    ),
    "compare": (
        Example("affinet compare runs/kept runs/kept", "settings, figures, and the first tick in which they part"),
        Example("affinet compare runs/kept runs/kept --out errors.png", "and their curves over each other"),
    ),
    "diff": (Example("affinet diff runs/kept --seed 8", "where it parts from a run of another seed, and after what"),),
    "report": (
        Example("affinet report runs/kept --out run.html", "a page with a scene, curves, faults, messages, settings"),
        Example("affinet report studies/bursts-quick", "its claims, figures and cases", alone=False),
    ),
    "export": (
        Example("affinet export runs/kept --to parquet", "a folder of tables, runs/kept-parquet"),
        Example("affinet export runs/kept --to mcap --out kept.mcap", "for Foxglove and PlotJuggler"),
    ),
    "check-determinism": (
        Example("affinet check-determinism corridor --duration 2", "the same bits, three times", "--duration 0.5"),
    ),
    "hunt": (
        Example(
            "affinet hunt corridor --invariant 'bounded(1000)' --verbs dropout --budget 20 --set time.dt=0.05 --duration 5",
            "exit status 1 when something breaks it",
            "--budget 2 --duration 1",
        ),
        Example(
            "affinet hunt corridor --invariant 'bounded(5)' --seeds 1-20 --corpus corpus --set time.dt=0.05 --duration 20",
            "of many seeds; what it finds flies first the next time",
            "--budget 2 --duration 1 --seeds 1-2",
        ),
        Example(
            "affinet hunt corridor --invariant 'bounded(5)' --every 'one link, up to 1 s, from any 0.5 s' --set time.dt=0.05 "
            "--duration 5",
            "every one of them: a certificate, or what breaks it",
            "--duration 1",
        ),
        Example(
            "affinet hunt corridor --invariant 'bounded(5)' --frontier broken.png --set time.dt=0.05 --duration 12",
            "how many links may be cut for how long: a picture, and its numbers",
            "--duration 0.5 --seeds 1-2",
        ),
    ),
    "study": (
        Example("affinet study bursts --quick", "a coarse version, of minutes, in studies/bursts-quick/", alone=False),
        Example(
            "affinet study mine.toml --out studies/mine --jobs 1", "your own (`affinet new study mine`)", "--quick"
        ),
    ),
    "score": (
        Example(
            "affinet score ga-rkf --quick", "in minutes, against others; a page in scores/ga-rkf-quick/", alone=False
        ),
        Example(
            "affinet score my_filter:MyFilter --against rkf,ga-rkf --out scores/mine",
            "your own, in full: what has flown there does not fly again",
            alone=False,
        ),
    ),
    "design": (
        Example("affinet design grid --agents 50 --range 2.25", "writes designed-grid.toml"),
        Example("affinet design random --agents 45 --dimension 3 --range 3 --seed 7 --out cloud.toml", "in space"),
    ),
    "fit": (Example("affinet fit runs/kept --order 2", "prints overrides for filters that predict inputs"),),
    "trace": (
        Example("affinet trace pings.txt", "losses, bursts and delays of a link"),
        Example("affinet trace pings.txt --fit gilbert --profile field.toml", "a chain, and the profile of it"),
    ),
    "inject": (
        Example("affinet inject runs/flying cut 1-2 --for 2", "while it flies over processes", alone=False),
        Example("affinet inject runs/flying heal", "ends what was injected", alone=False),
    ),
    "keys": (Example("affinet keys keys --agents 7 --hub 10.0.0.1", "before runs over several machines"),),
    "hosts": (Example("affinet hosts hosts.toml", "docs/machines.md has the file", alone=False),),
    "world": (
        Example(
            "affinet world corridor --listen tls/10.0.0.1:7447 --keys keys", "on the machine of the world", alone=False
        ),
    ),
    "agent": (
        Example(
            "affinet agent 4 5 --connect tls/10.0.0.1:7447 --keys keys", "on the machine of agents 4 and 5", alone=False
        ),
    ),
    "host": (
        Example("affinet host 1 --connect tls/10.0.0.1:7447 --keys keys", "several agents in one process", alone=False),
    ),
    "netem": (
        Example(
            "affinet netem --connect tls/10.0.0.1:7447 --listen tls/10.0.0.2:7448 --keys keys",
            "on the machine of the air",
            alone=False,
        ),
    ),
    "conformance": (Example("affinet conformance 'python my_agent.py'", "docs/agents.md has one", alone=False),),
    "list": (
        Example("affinet list", "which kinds there are"),
        Example("affinet list estimators", "all, with parameters, units and defaults"),
        Example("affinet list estimators ga-rkf", "one"),
        Example("affinet list verbs --json", "for programs"),
    ),
    "schema": (
        Example("affinet schema", "of a scenario file"),
        Example("affinet schema study --out affinet.study.schema.json", "of a study file, into a file"),
    ),
    "new": (
        Example("affinet new scenario maze", "maze.toml, and a schema by which editors complete it"),
        Example("affinet new estimator my-filter", "my_filter.py, my_filter.toml that flies it, and a test"),
        Example("affinet new project my-swarm", "a package with a scenario, an estimator, a law, a study and tests"),
    ),
    "doctor": (
        Example("affinet doctor", "what is wrong, and the way out"),
        Example("affinet doctor --json", "for programs"),
    ),
    "completion": (
        Example("affinet completion bash > ~/.local/share/bash-completion/completions/affinet", "once", alone=False),
        Example("affinet completion zsh", "prints it"),
        Example("affinet completion fish", "prints it"),
    ),
}
